"""Drawn floors with few corners, and how many of their pairs each structure joins."""

import numpy as np
import pytest

from lidarium.benchmarks.studies.merging.structure import (
    KINDS,
    SIDE_M,
    compare_structures,
    draw_regions,
    drawn_floor,
    floor_pairs,
    seen_by,
    structure_text,
)
from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.grids.occupancy import FREE, OCCUPIED
from lidarium.mapping.merging.settings import STRUCTURES


@pytest.mark.parametrize("kind", KINDS)
def test_floors_are_those_of_their_seed_and_walls_close_them(kind):
    floor = drawn_floor(kind, 3)
    np.testing.assert_array_equal(floor, drawn_floor(kind, 3))
    assert (floor != drawn_floor(kind, 4)).any()
    free = floor == FREE
    assert 60.0 < free.sum() * SIDE_M**2 < 400.0
    for axis in (0, 1):
        for step in (-1, 1):
            beside = np.roll(floor, step, axis=axis)[free]
            assert np.isin(beside, (FREE, OCCUPIED)).all()


def test_what_a_robot_sees_is_true():
    floor, frame = drawn_floor("corridor", 1), Transform(2.0, 3.0, 0.4)
    view = seen_by(floor, (0.0, 0.6), frame, (1, 2))
    rows, columns = np.nonzero(view.levels == FREE)
    places = frame.inverse().apply(np.column_stack([columns, rows]) * SIDE_M + 0.5 * SIDE_M)
    cells = np.floor(places / SIDE_M).astype(int)
    assert (floor[cells[:, 1], cells[:, 0]] == FREE).mean() > 0.97
    assert 0.2 < (view.known & (floor == FREE)).sum() / (floor == FREE).sum() < 0.9


def test_pairs_of_a_floor_overlap_and_strangers_have_no_transform():
    pairs = list(floor_pairs("hall", 2))
    assert [pair.a_from_b is None for pair in pairs].count(True) == 2
    (first, *_) = pairs
    known = np.argwhere(first.b == OCCUPIED)[:, ::-1] * SIDE_M
    cells = np.floor(first.a_from_b.apply(known) / SIDE_M).astype(int)
    inside = ((cells >= 1) & (cells < first.a.shape[0] - 1)).all(axis=1)
    near = [(first.a[y - 1 : y + 2, x - 1 : x + 2] == OCCUPIED).any() for x, y in cells[inside].tolist()]
    assert np.mean(near) > 0.5


def test_each_structure_is_a_line_of_the_table(tmp_path):
    rows = compare_structures(None, 1)
    assert {row["structure"] for row in rows} == set(STRUCTURES)
    assert all(row["right"] + row["wrong"] <= row["pairs"] for row in rows)
    text = structure_text(rows, {"corners": []})
    assert text.count("\n| halls | ") == len(STRUCTURES)
    draw_regions(tmp_path / "merging_regions.png")
    assert (tmp_path / "merging_regions.png").stat().st_size > 10_000
