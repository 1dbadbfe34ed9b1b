"""What came of two maps, and of the maps once they are bent."""

from dataclasses import replace

import pytest
from drawn_maps import RESOLUTION, apartment, blank, bowed, hall

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.merging.description.described_map import describe_map
from lidarium.mapping.merging.pair_result import PairResult, explained, or_bent
from lidarium.mapping.merging.settings import MergeSettings

SETTINGS = MergeSettings()
REFUSED = PairResult(False, "contradiction", Transform(0.05, 0.05, 0.0), tried=(Transform(3.0, 1.0, 0.4),))


@pytest.fixture(scope="module")
def maps():
    """A hall, and the same as drift has bent it."""
    return describe_map(hall(), RESOLUTION), describe_map(bowed(hall(), 0.3), RESOLUTION)


def test_what_was_tried_is_ranked_with_the_best_first(maps):
    known = explained(*maps, REFUSED, SETTINGS)
    assert len(known.ranked) == 2
    evidence = [one.evidence_m for one in known.ranked]
    assert evidence == sorted(evidence, reverse=True)
    assert abs(known.ranked[0].bend.a_from_b.theta) < 0.05
    assert known.confidence > 0.9
    assert (known.is_accepted, known.a_from_b) == (False, REFUSED.a_from_b)
    assert explained(*maps, known, SETTINGS) is known


def test_maps_without_walls_are_explained_by_nothing(maps):
    none = describe_map(blank(), RESOLUTION)
    assert explained(maps[0], none, REFUSED, SETTINGS) is REFUSED
    assert explained(none, maps[0], REFUSED, SETTINGS) is REFUSED
    without = explained(*maps, PairResult(False, "too few corners"), SETTINGS)
    assert (without.ranked, without.confidence) == ((), 0.0)


def test_a_refused_pair_is_accepted_where_it_agrees_bent(maps):
    found = or_bent(*maps, replace(REFUSED, inliers=7), SETTINGS)
    assert (found.is_accepted, found.reason, found.found_by) == (True, "accepted", "bend")
    assert found.inliers == 0
    assert found.a_from_b == found.ranked[0].bend.a_from_b
    assert found.agreement is found.ranked[0].agreement
    assert found.score == found.agreement.score


def test_what_is_not_believed_stays_refused(maps):
    assert or_bent(*maps, replace(REFUSED, is_accepted=True), SETTINGS).found_by == "corners"
    for settings in (
        replace(SETTINGS, confidence=2.0),
        replace(SETTINGS, bend=replace(SETTINGS.bend, candidates=0)),
    ):
        assert or_bent(*maps, REFUSED, settings) is REFUSED
    other = describe_map(apartment(), RESOLUTION)
    unsure = or_bent(maps[0], other, replace(REFUSED, a_from_b=Transform(1.0, 2.0, 0.7), tried=()), SETTINGS)
    assert not unsure.is_accepted
    assert unsure.reason == "contradiction"
    assert unsure.confidence < SETTINGS.confidence
