"""Rooms on a lattice, their walls and doors."""

import numpy as np
import pytest
from scipy import ndimage

from lidarium.envs.floors.generation.layouts import (
    HALL,
    JAMB,
    OUTSIDE,
    Boundary,
    Proportions,
    _lattice_edges,
    _split,
    apartment_layout,
    boundaries,
    cells,
    choose_doors,
    corridor_layout,
    metres,
    office_layout,
    outside_rectangles,
    room_areas,
    wall_rectangles,
)


def plan(text):
    """Read a plan from rows of digits, row 0 first; a dot is outside."""
    return np.array([[-1 if letter == "." else int(letter) for letter in row] for row in text.split()], np.int32)


def large(text, times=20):
    """Return a plan whose letters are squares of 2 m."""
    return np.kron(plan(text), np.ones((times, times), np.int32))


def area_of(rectangles):
    return sum((right - left) * (high - low) for left, low, right, high in rectangles)


def test_a_boundary_ends_where_the_rooms_beside_it_change():
    found = boundaries(plan(".... .01. .00. ...."))
    inner = [b for b in found if b.low >= 0 and b.high >= 0]
    assert inner == [Boundary(True, 0.2, 0.1, 0.2, 0, 1), Boundary(False, 0.2, 0.2, 0.3, 1, 0)]
    assert sum(b.length for b in found) == pytest.approx(8 * 0.1 + 2 * 0.1)


def test_areas_are_of_the_labels():
    assert room_areas(plan("..0 112")).tolist() == pytest.approx([0.01, 0.02, 0.01])


@pytest.mark.parametrize("seed", range(5))
def test_doors_join_all_rooms_and_lie_within_their_walls(seed):
    labels = large("111 000 234")
    doors = choose_doors(labels, 0.9, 0.0, np.random.default_rng(seed))
    assert len(doors) == 4
    assert {label for door in doors for label in (door.boundary.low, door.boundary.high)} == {0, 1, 2, 3, 4}
    assert all(0 in (door.boundary.low, door.boundary.high) for door in doors)
    for door in doors:
        assert door.end - door.start == pytest.approx(0.9)
        assert door.start >= door.boundary.start + JAMB - 1e-6
        assert door.end <= door.boundary.end - JAMB + 1e-6


def test_more_loops_keep_the_doors_of_fewer():
    few, many = (choose_doors(large("12 00 34", 30), 0.9, loops, np.random.default_rng(3)) for loops in (0.0, 1.0))
    assert len(few) == 4
    assert len(many) == 6
    assert [door.boundary for door in many[:4]] == [door.boundary for door in few]


def test_rooms_that_no_wall_is_long_enough_for_are_not_joined():
    assert choose_doors(large("01", 10), 0.9, 0.0, np.random.default_rng(0)) is None


def test_walls_leave_the_doors_open_and_close_corners():
    labels = large("111 000 234")
    doors = choose_doors(labels, 0.9, 0.0, np.random.default_rng(0))
    rectangles = wall_rectangles(labels, doors, 0.1)
    inner = 2 * 6.0 + 2 * 2.0 - 4 * 0.9
    assert area_of(rectangles) == pytest.approx(0.1 * (inner + 4 * 0.1))


def test_what_is_outside_is_covered_once():
    labels = plan("..00 ..00 0... 0..0")
    rectangles = outside_rectangles(labels)
    painted = np.zeros(labels.shape, int)
    for left, low, right, high in rectangles:
        painted[cells(low) : cells(high), cells(left) : cells(right)] += 1
    assert np.array_equal(painted, (labels == -1).astype(int))
    assert len(rectangles) == 3
    assert outside_rectangles(plan("00")) == []


def test_lengths_are_whole_cells_without_dust():
    assert [metres(cells(length)) for length in (0.3, 0.7, 1.1)] == [0.3, 0.7, 1.1]


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
