"""Hypotheses are ranked, and what speaks against them is weighed."""

import math
from dataclasses import replace

import numpy as np
import pytest
from drawn_maps import RESOLUTION, apartment, blank, bowed, hall, room, sagging

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.merging.agreement import ValidationSettings, compare
from lidarium.mapping.merging.bend.estimation import Bend, BendSettings, OffsetField
from lidarium.mapping.merging.bend.hypotheses import (
    BLUNT_M,
    MAX_RIVAL_SHARE,
    MAX_STRAIN,
    MIN_OVERLAP_M2,
    SHARP_M,
    _Signs,
    _tolerance,
    compare_bent,
    confidence_of,
    is_other,
    ranked_hypotheses,
    signs_of,
    why_unsure,
)
from lidarium.mapping.merging.described_map import describe_map
from lidarium.mapping.merging.pair import described, merge_pair
from lidarium.mapping.merging.settings import MergeSettings

PLAIN = _Signs(30.0, 0.85, 80.0, 15.0, 0.2, 80.0, 3.0, 0.01, 0.05)


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


def test_hypotheses_are_of_different_places():
    a, b = (describe_map(levels, RESOLUTION) for levels in (hall(), bowed(hall(), 0.2)))
    starts = [Transform(), Transform(0.1, 0.0, 0.01), Transform(0.0, 0.2, 0.0), Transform(3.0, 1.0, 0.4)]
    ranked = ranked_hypotheses(a, b, starts[:3], BendSettings(), starts[3:])
    assert len(ranked) == 2
    assert is_other(*ranked)
    assert not is_other(ranked[0], Transform())
    assert ranked_hypotheses(a, b, [], BendSettings()) == []


@pytest.mark.parametrize(
    ("changed", "reason"),
    [
        ({"rival_share": 0.7}, "ambiguous: another place explains 70 % as much"),
        ({"overlap_m2": 12.0}, "small overlap: 12.0 m2"),
        ({"evidence_m": 3.0}, "small overlap: 3.0 m of walls"),
        (
            {"scale": 0.97, "growth_share": 0.9, "growth_m": 0.3},
            "unlike scales: the second map would have to grow about 0.970 times",
        ),
        ({"strain": 0.07}, "contradiction: one map would be stretched by 7.0 %, want at most 6 %"),
        (
            {"strain": 0.04, "overlap_m2": 20.0},
            "contradiction: one map would be stretched by 4.0 %, want at most 3.5 %",
        ),
        ({"spread_m": 0.02, "overlap_m2": 20.0}, "contradiction: 85 % of the walls of sharp maps"),
    ],
)
def test_what_excludes_a_hypothesis_is_its_reason(changed, reason):
    signs = PLAIN._replace(**changed)
    assert confidence_of(signs) == 0.0
    assert why_unsure(signs, 0.8).startswith(reason)


def test_a_hypothesis_that_nothing_excludes_is_refused_by_its_confidence():
    doubtful = PLAIN._replace(quality=0.3, contradicting_m=40.0, evidence_m=8.0)
    assert 0.0 < confidence_of(doubtful) < 0.8
    assert why_unsure(doubtful, 0.8) == f"contradiction: the confidence is {confidence_of(doubtful):.2f}, want 0.8"
    assert why_unsure(PLAIN, 2.0) == "contradiction: the maps agree only once they are bent"


def test_drift_that_also_grows_a_map_is_no_other_scale():
    for scale, share, growth_m in ((1.034, 0.73, 0.3), (1.01, 1.0, 0.3), (1.025, 0.9, 0.15)):
        grown = PLAIN._replace(scale=scale, growth_share=share, growth_m=growth_m)
        assert confidence_of(grown) == confidence_of(PLAIN)


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
    sure = _Signs(500.0, 0.99, 900.0, 200.0, 0.0, 500.0, 0.0, 0.0, 0.01)
    assert confidence_of(sure) > 0.999
    assert confidence_of(sure._replace(overlap_m2=0.99 * MIN_OVERLAP_M2)) == 0.0
    assert confidence_of(sure._replace(rival_share=MAX_RIVAL_SHARE + 0.01)) == 0.0
    assert confidence_of(sure._replace(evidence_m=0.0)) == 0.0
    assert confidence_of(sure._replace(strain=1.1 * MAX_STRAIN)) == 0.0


def test_sharp_maps_of_a_few_rooms_may_differ_by_furniture_alone():
    rooms = _Signs(40.0, 0.95, 40.0, 15.0, 0.2, 60.0, 2.0, 0.005, 0.02)
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


def bend_of(offsets, pose=(0.0, 0.0, 0.0)):
    field = OffsetField((0.0, 0.0), 1.0, np.asarray(offsets, np.float64))
    return Bend(Transform(*pose), field, 0.0, 0.0, 0.01, 1.0, np.eye(3))


def test_the_tolerance_grows_with_the_spread_between_two_limits():
    straight = bend_of(np.zeros((2, 2, 2)))
    found = [_tolerance(replace(straight, spread_m=spread), 0.025)[0] for spread in (0.0, 0.04, 1.0)]
    assert found == pytest.approx([SHARP_M, 0.1, BLUNT_M])
    assert _tolerance(straight, 0.2)[0] == pytest.approx(0.3)
    for resolution in (0.025, 0.1, 0.4):
        hit, miss = _tolerance(straight, resolution)
        assert hit < miss


@pytest.mark.parametrize("pose", [(0.0, 0.0, 0.0), (0.2, -0.1, 0.05)])
def test_maps_without_bend_agree_as_rigid_ones_do(pose):
    one = describe_map(apartment(), RESOLUTION)
    rigid = compare(one, one, Transform(*pose), ValidationSettings())
    bent = compare_bent(one, one, bend_of(np.zeros((3, 3, 2)), pose))
    assert bent.overlap_m2 == rigid.overlap_m2
    assert bent.agreeing_m == pytest.approx(rigid.agreeing_m, abs=0.2)
    assert bent.contradicting_m == pytest.approx(rigid.contradicting_m, abs=0.2)


def test_a_bowed_map_agrees_only_once_its_bow_is_undone():
    length = hall().shape[1] * RESOLUTION
    a, b = (describe_map(levels, RESOLUTION) for levels in (hall(), bowed(hall(), 0.4)))
    rows, columns = math.ceil(hall().shape[0] * RESOLUTION) + 1, math.ceil(length) + 1
    nodes = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1).reshape(-1, 2).astype(float)
    offsets = -sagging(nodes, 0.4, length).reshape(rows, columns, 2)
    rigid = compare_bent(a, b, bend_of(np.zeros_like(offsets)))
    bent = compare_bent(a, b, bend_of(offsets))
    assert rigid.hit_rate < 0.7
    assert bent.hit_rate > 0.95
    assert bent.contradicting_m < 0.1 * rigid.contradicting_m
