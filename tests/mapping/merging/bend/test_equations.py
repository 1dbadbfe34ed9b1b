"""Gaps between walls, and the normal equations that close them."""

import numpy as np
import pytest
from drawn_maps import RESOLUTION, blank, room

from lidarium.mapping.merging.bend.equations import add_springs, add_walls, find_gaps
from lidarium.mapping.merging.description.described_map import describe_map


def dense(band):
    """The symmetric matrix whose lower triangle a band holds: entry (i, j) is at (i - j, j)."""
    count = band.shape[1]
    lower = np.zeros((count, count))
    for below in range(band.shape[0]):
        for column in range(count - below):
            lower[column + below, column] = band[below, column]
        assert (band[below, count - below :] == 0.0).all()
    return lower + np.tril(lower, -1).T


def test_gaps_are_signed_along_the_normal_and_none_is_found_out_of_reach():
    described = describe_map(room(blank(120, 120), 30, 30, 60, 60), RESOLUTION)
    # Places before, on and behind the lower wall (its face is in row 29), and one far from all walls.
    rows = np.array([27.5, 29.5, 32.5, 60.5])
    places = np.stack([np.full(4, 60.5), rows], axis=1) * RESOLUTION
    gaps, found = np.empty(4), np.empty(4, np.bool_)
    find_gaps(
        described.levels,
        described.distance,
        RESOLUTION,
        places,
        np.tile((0.0, 1.0), (4, 1)),
        0.4,
        gaps,
        found,
    )
    assert found.tolist() == [True, True, True, False]
    np.testing.assert_allclose(gaps, np.array([2.0, 0.0, -3.0, 0.0]) * RESOLUTION)


def test_walls_add_the_squares_of_what_they_want():
    generator = np.random.default_rng(7)
    count, nodes_in_all, columns = 12, 12, 4
    left = generator.integers(0, 7, count)
    nodes = np.stack([left, left + 1, left + columns, left + columns + 1], axis=1)
    weights, normals = generator.random((count, 4)), generator.normal(size=(count, 2))
    offsets, gaps = generator.normal(size=(nodes_in_all, 2)), generator.normal(size=count)
    trust = np.where(generator.random(count) < 0.3, 0.0, generator.random(count))
    band, right = np.zeros((2 * columns + 4, 2 * nodes_in_all)), np.zeros(2 * nodes_in_all)
    add_walls(nodes, weights, normals, offsets, gaps, trust, band, right)
    rows = np.zeros((count, 2 * nodes_in_all))
    for i in range(count):
        for j in range(4):
            rows[i, 2 * nodes[i, j] : 2 * nodes[i, j] + 2] += weights[i, j] * normals[i]
    np.testing.assert_allclose(dense(band), rows.T @ (trust[:, None] * rows), atol=1e-12)
    np.testing.assert_allclose(right, rows.T @ (trust * (gaps + rows @ offsets.ravel())), atol=1e-12)


@pytest.mark.parametrize(("rows", "columns"), [(3, 4), (1, 5), (5, 1), (1, 1)])
def test_springs_join_neighbours_in_rows_and_columns_alone(rows, columns):
    band = np.zeros((2 * columns + 4, 2 * rows * columns))
    add_springs(columns, 0.5, band)
    expected = np.zeros((2 * rows * columns,) * 2)
    for one in range(rows * columns):
        for other in range(one):
            apart = abs(one // columns - other // columns) + abs(one % columns - other % columns)
            for axis in range(2) if apart == 1 else ():
                spring = np.zeros(2 * rows * columns)
                spring[2 * one + axis], spring[2 * other + axis] = 1.0, -1.0
                expected += 0.5 * np.outer(spring, spring)
    np.testing.assert_allclose(dense(band), expected)
