"""Hypotheses are ranked, and what speaks against them is weighed."""

import pytest
from drawn_maps import RESOLUTION, blank, bowed, hall, room

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.merging.bend.estimation import BendSettings
from lidarium.mapping.merging.bend.hypotheses import (
    LEAST_OVERLAP_M2,
    MOST_RIVAL_SHARE,
    MOST_STRAIN,
    Signs,
    confidence_of,
    ranked_hypotheses,
    signs_of,
)
from lidarium.mapping.merging.description.described_map import describe_map
from lidarium.mapping.merging.pair import described, merge_pair
from lidarium.mapping.merging.settings import MergeSettings

PLAIN = Signs(30.0, 0.85, 80.0, 15.0, 0.2, 80.0, 3.0, 0.01, 0.05)


def test_the_best_hypothesis_leads_and_others_are_told():
    a, b = (describe_map(levels, RESOLUTION) for levels in (hall(), bowed(hall(), 0.2)))
    wrong = Transform(3.0, 1.0, 0.4)
    ranked = ranked_hypotheses(a, b, [wrong, Transform()], BendSettings())
    assert len(ranked) == 2
    assert abs(ranked[0].bend.a_from_b.theta) < 0.05
    signs = signs_of(a, b, ranked)
    assert signs.rival_share < 0.3
    assert signs.overlap_m2 > 80.0
    assert ranked_hypotheses(a, b, [wrong, Transform()], BendSettings(candidates=1))[0].evidence_m > 20.0


@pytest.mark.parametrize(
    ("sign", "worse"),
    [
        ("evidence_m", 8.0),
        ("quality", 0.4),
        ("overlap_m2", 20.0),
        ("across_m", 1.0),
        ("rival_share", 0.65),
        ("extent_m", 600.0),
        ("contradicting_m", 25.0),
    ],
)
def test_each_sign_speaks_for_or_against_a_place(sign, worse):
    assert confidence_of(PLAIN) > 0.95
    assert confidence_of(PLAIN._replace(**{sign: worse})) < confidence_of(PLAIN)


def test_small_overlaps_and_near_rivals_are_never_believed():
    sure = Signs(500.0, 0.99, 900.0, 200.0, 0.0, 500.0, 0.0, 0.0, 0.01)
    assert confidence_of(sure) > 0.999
    assert confidence_of(sure._replace(overlap_m2=0.99 * LEAST_OVERLAP_M2)) == 0.0
    assert confidence_of(sure._replace(rival_share=MOST_RIVAL_SHARE + 0.01)) == 0.0
    assert confidence_of(sure._replace(evidence_m=0.0)) == 0.0
    assert confidence_of(sure._replace(strain=1.1 * MOST_STRAIN)) == 0.0


def test_sharp_maps_of_a_few_rooms_may_differ_by_furniture_alone():
    rooms = Signs(40.0, 0.95, 40.0, 15.0, 0.2, 60.0, 2.0, 0.005, 0.02)
    assert confidence_of(rooms) > 0.95
    assert confidence_of(rooms._replace(quality=0.85)) == 0.0
    assert confidence_of(rooms._replace(quality=0.85, spread_m=0.05)) > 0.9
    assert confidence_of(rooms._replace(quality=0.85, overlap_m2=200.0)) > 0.9


def test_strangers_are_refused_whatever_the_tolerance():
    other = blank(200, 240)
    room(other, 10, 10, 120, 60)
    room(other, 10, 73, 60, 150)
    room(other, 73, 73, 57, 90)
    other[60:75, 70:73] = 255
    other[70:73, 100:118] = 255
    chosen = MergeSettings(confidence=0.6)
    result = merge_pair(described(hall(), RESOLUTION, chosen), described(other, RESOLUTION, chosen), chosen)
    assert not result.is_accepted
    assert result.confidence < 0.6
