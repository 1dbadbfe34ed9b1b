"""Plans that are drawn by seed."""

import numpy as np
import pytest
from scipy import ndimage

from lidarium.envs.floors.generation.layouts import (
    Proportions,
    _lattice_edges,
    _split,
    apartment_layout,
    corridor_layout,
    office_layout,
)
from lidarium.envs.floors.generation.plans import HALL, OUTSIDE, room_areas

LAYOUTS = {
    "apartment": (apartment_layout, Proportions(80.0, 1.3, (2.4, 4.2), 0.0)),
    "office": (office_layout, Proportions(320.0, 1.9, (2.6, 5.5), 0.5)),
    "corridors": (corridor_layout, Proportions(200.0, 2.0, (2.6, 5.5), 0.5)),
}


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("kind", LAYOUTS)
def test_each_room_is_one_piece_and_about_as_much_is_drawn_as_is_asked_for(kind, seed):
    layout, proportions = LAYOUTS[kind]
    labels = layout(proportions, np.random.default_rng(seed))
    assert labels.dtype == np.int32
    assert HALL in labels
    for room in np.unique(labels[labels != OUTSIDE]):
        assert ndimage.label(labels == room)[1] == 1
    assert room_areas(labels).sum() == pytest.approx(proportions.area_m2, rel=0.25)
    again = layout(proportions, np.random.default_rng(seed))
    assert np.array_equal(labels, again)


@pytest.mark.parametrize("seed", range(4))
def test_lattice_edges_are_a_tree_and_a_share_of_the_others(seed):
    for loops, count in ((0.0, 11), (0.5, 14), (1.0, 17)):
        edges = _lattice_edges(3, 4, loops, np.random.default_rng(seed))
        assert len(set(edges)) == len(edges) == count
        reached = {(0, 0)}
        for _ in range(12):
            reached |= {node for edge in edges for node in edge if set(edge) & reached}
        assert len(reached) == 12


@pytest.mark.parametrize("seed", range(5))
def test_pieces_fill_a_length_and_none_is_too_short(seed):
    edges = _split(97, 20, 30, np.random.default_rng(seed))
    assert (edges[0], edges[-1]) == (0, 97)
    assert (np.diff(edges) >= 19).all()
    assert 3 <= len(edges) - 1 <= 4
