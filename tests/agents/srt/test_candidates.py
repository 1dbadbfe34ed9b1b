"""Candidates of a node: where they lie, and which are no more."""

import math

import numpy as np
import pytest
from seen_from_nodes import BODY, HERE, PERCEPTION, box_view, node

from lidarium.agents.srt.candidates import CandidateSource
from lidarium.agents.srt.memories import RegionMemory
from lidarium.agents.srt.safe_region import DIRECTIONS, openings_of
from lidarium.agents.srt.settings import SrtSettings


def test_an_opening_that_was_seen_through_stays_closed():
    opening = openings_of(HERE, box_view(door=(0.5, 0.8)), PERCEPTION, BODY, with_blind=False)[0]
    assert len(opening.open_points(lambda points: np.zeros(len(points), bool), 0.5))
    assert not len(opening.open_points(lambda points: np.ones(len(points), bool), 0.5))
    assert not len(opening.open_points(lambda points: np.zeros(len(points), bool), 0.5))


@pytest.mark.parametrize("candidates", ["random", "farthest", "goal"])
def test_candidates_lie_within_the_safe_region_far_enough_and_outside_of_others(candidates):
    start = node(0, (0.0, 0.0), box_view(door=(0.4, 0.9)))
    wanted = SrtSettings(candidates=candidates, memory="regions")
    source = CandidateSource(wanted, BODY, np.random.default_rng(3))
    found = source.of_node(start, RegionMemory([start]), [start])
    assert found
    for candidate in found:
        assert bool(start.safe.contains(candidate.place))
        assert math.dist(candidate.place, start.place) > wanted.least_step
        source.note_tried(candidate)
    other = node(1, found[0].place, np.full(DIRECTIONS, 6.0), 0)
    assert source.of_node(start, RegionMemory([start, other]), [start, other]) == []


def test_the_base_algorithm_keeps_out_of_all_other_regions():
    wanted = SrtSettings(algorithm="base", memory="regions")
    source = CandidateSource(wanted, BODY, np.random.default_rng(3))
    start = node(0, (0.0, 0.0), box_view())
    assert len(source.of_node(start, RegionMemory([start]), [start])) == 1
    other = node(1, (0.3, 0.0), np.full(DIRECTIONS, 6.0), 0)
    assert source.of_node(start, RegionMemory([start, other]), [start, other]) == []
