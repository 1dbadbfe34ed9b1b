"""Openings at the rim of what was seen."""

import numpy as np
import pytest
from seen_from_nodes import BODY, HERE, PERCEPTION, box_view

from lidarium.agents.srt.frontier_arcs import openings_of
from lidarium.agents.srt.safe_region import (
    DIRECTIONS,
    STEP,
)


def test_a_closed_room_has_no_opening_and_a_door_is_one():
    assert openings_of(HERE, box_view(), PERCEPTION, BODY, with_blind=False) == []
    arcs = [
        each
        for each in openings_of(HERE, box_view(door=(0.5, 0.8)), PERCEPTION, BODY, with_blind=False)
        if not each.is_gap
    ]
    assert len(arcs) == 1
    assert arcs[0].width == pytest.approx(0.3, abs=0.02)
    assert arcs[0].lengths.sum() == pytest.approx(0.3 * PERCEPTION, rel=0.05)


def test_an_arc_across_the_first_direction_is_one_and_a_narrow_one_is_none():
    across = box_view()
    across[:60], across[-60:] = np.inf, np.inf
    assert [
        each.width
        for each in openings_of(HERE, across, PERCEPTION, BODY, with_blind=False)
        if not each.is_gap
    ] == [pytest.approx(120 * STEP)]
    narrow = [
        each
        for each in openings_of(HERE, box_view(door=(0.5, 0.54)), PERCEPTION, BODY, with_blind=False)
        if not each.is_gap
    ]
    assert narrow == []


def test_a_gap_beside_an_edge_is_looked_into_on_the_hidden_side():
    view = np.full(DIRECTIONS, 3.0)
    view[: DIRECTIONS // 4] = 1.0
    gaps = openings_of(HERE, view, PERCEPTION, BODY, with_blind=False)
    assert len(gaps) == 2
    first = next(each for each in gaps if each.points[0, 1] > 0.5)
    assert (first.beyond[:, 0] > first.points[:, 0]).all()
    assert np.linalg.norm(first.points, axis=1).min() >= 1.0
    assert np.linalg.norm(first.points, axis=1).max() <= 3.0
