"""How much maps are bent against each other is estimated from both."""

import math

import numpy as np
import pytest
from drawn_maps import RESOLUTION, about_middle, apartment, blank, bowed, hall, moved, room, sagging

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.merging.bend.estimation import (
    BendSettings,
    OffsetField,
    _add_springs,
    _add_walls,
    _bilinear,
    _find_gaps,
    _solved,
    estimate_bend,
)
from lidarium.mapping.merging.bend.hypotheses import _tolerance, compare_bent
from lidarium.mapping.merging.described_map import describe_map
from lidarium.mapping.merging.pair import described, merge_pair
from lidarium.mapping.merging.settings import MergeSettings


def test_offsets_solve_the_plain_normal_equations():
    generator = np.random.default_rng(5)
    columns, rows, stiffness = 5, 4, 0.3
    count = columns * rows
    points = generator.random((60, 2)) * (columns - 1, rows - 1)
    nodes, weights = _bilinear(points, (0.0, 0.0), 1.0, (rows, columns))
    normals, gaps = generator.normal(size=(60, 2)), 0.1 * generator.normal(size=60)
    found = generator.random(60) < 0.8
    solved = _solved(nodes, weights, normals, np.zeros((count, 2)), (gaps, found, 0.5), (columns, stiffness))
    trust = np.where(found, 1.0 / (1.0 + (2.0 * gaps / 0.5) ** 2), 0.0)
    rows_of = np.zeros((60, 2 * count))
    for i in range(60):
        for j in range(4):
            rows_of[i, 2 * nodes[i, j] : 2 * nodes[i, j] + 2] += weights[i, j] * normals[i]
    matrix = rows_of.T @ (trust[:, None] * rows_of)
    strength = trust.sum() / count
    for row in range(rows):
        for column in range(columns):
            for down, right in ((0, 1), (1, 0)):
                if row + down < rows and column + right < columns:
                    one, other = row * columns + column, (row + down) * columns + column + right
                    for axis in range(2):
                        spring = np.zeros(2 * count)
                        spring[2 * one + axis], spring[2 * other + axis] = 1.0, -1.0
                        matrix += stiffness * strength * np.outer(spring, spring)
    matrix += 1e-3 * strength * np.eye(2 * count)
    plain = np.linalg.solve(matrix, rows_of.T @ (trust * gaps)).reshape(count, 2)
    np.testing.assert_allclose(solved, plain, atol=1e-10)


@pytest.mark.parametrize("sag", [0.2, 0.35, 0.5])
@pytest.mark.parametrize("theta", [0.0, 2.2])
def test_bent_maps_are_joined_and_their_bend_is_found(sag, theta):
    straight, bent = hall(), bowed(hall(), sag)
    truth = Transform(12.0, 3.0, theta)
    shape = (700, 700)
    settings = MergeSettings()
    lying = moved(straight, Transform(17.0, 17.0, 0.0) @ Transform(0.0, 0.0, theta), shape)
    truth = Transform(17.0, 17.0, theta)
    a, b = (described(levels, RESOLUTION, settings) for levels in (lying, bent))
    result = merge_pair(a, b, settings)
    assert result.is_accepted, result.reason
    found = estimate_bend(a, b, result.a_from_b, settings.bend)
    length = straight.shape[1] * RESOLUTION
    # Where a wall of the bent map belongs, and where it is put once the bend is known.
    walls = b.walls[::7]
    belongs = truth.apply(walls - sagging(walls, sag, length))
    errors = np.linalg.norm(found.field.bent(found.a_from_b, walls) - belongs, axis=1)
    assert np.median(errors) < 0.05
    assert np.quantile(errors, 0.9) < 0.1
    assert found.scale == pytest.approx(1.0, abs=0.02)
    assert found.bend_m == pytest.approx(sag * 0.3, abs=0.1)


def test_the_scale_of_a_map_is_told():
    rows, columns = (np.floor(np.arange(side) / 1.02).astype(int) for side in hall().shape)
    large = hall()[np.ix_(rows, columns)]
    settings = MergeSettings()
    a, b = (described(levels, RESOLUTION, settings) for levels in (large, hall()))
    bend = estimate_bend(a, b, Transform(), settings.bend)
    assert bend.scale == pytest.approx(1.02, abs=0.006)


def test_maps_without_bend_keep_their_motion_and_a_sharp_tolerance():
    settings = MergeSettings()
    truth = about_middle(0.6, apartment())
    a, b = (described(levels, RESOLUTION, settings) for levels in (moved(apartment(), truth), apartment()))
    bend = estimate_bend(a, b, truth, BendSettings())
    assert bend.bend_m < 0.03
    distance, angle = bend.a_from_b.difference(truth, (5.0, 4.0))
    assert distance < 0.03
    assert angle < math.radians(0.3)
    assert _tolerance(bend, RESOLUTION)[0] < 0.1
    agreement = compare_bent(a, b, bend)
    assert agreement.hit_rate > 0.95
    assert agreement.contradicting_m < 0.2
    deviations = np.sqrt(np.linalg.eigvalsh(bend.covariance))
    assert 1e-5 < deviations[0] < 0.01  # of the angle
    assert RESOLUTION < deviations[1] <= deviations[2] < 0.06


def test_maps_that_do_not_meet_have_no_bend():
    a, b = (describe_map(levels, RESOLUTION) for levels in (apartment(), apartment()))
    bend = estimate_bend(a, b, Transform(500.0, 0.0, 0.0), BendSettings())
    assert not bend.is_held
    assert bend.bend_m == 0.0
    assert compare_bent(a, b, bend).overlap_m2 == 0.0


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
    _find_gaps(
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
    _add_walls(nodes, weights, normals, offsets, gaps, trust, band, right)
    rows = np.zeros((count, 2 * nodes_in_all))
    for i in range(count):
        for j in range(4):
            rows[i, 2 * nodes[i, j] : 2 * nodes[i, j] + 2] += weights[i, j] * normals[i]
    np.testing.assert_allclose(dense(band), rows.T @ (trust[:, None] * rows), atol=1e-12)
    np.testing.assert_allclose(right, rows.T @ (trust * (gaps + rows @ offsets.ravel())), atol=1e-12)


@pytest.mark.parametrize(("rows", "columns"), [(3, 4), (1, 5), (5, 1), (1, 1)])
def test_springs_join_neighbours_in_rows_and_columns_alone(rows, columns):
    band = np.zeros((2 * columns + 4, 2 * rows * columns))
    _add_springs(columns, 0.5, band)
    expected = np.zeros((2 * rows * columns,) * 2)
    for one in range(rows * columns):
        for other in range(one):
            apart = abs(one // columns - other // columns) + abs(one % columns - other % columns)
            for axis in range(2) if apart == 1 else ():
                spring = np.zeros(2 * rows * columns)
                spring[2 * one + axis], spring[2 * other + axis] = 1.0, -1.0
                expected += 0.5 * np.outer(spring, spring)
    np.testing.assert_allclose(dense(band), expected)


def field(seed=0):
    generator = np.random.default_rng(seed)
    return OffsetField((-1.0, 2.0), 1.5, generator.normal(0.0, 0.05, (4, 5, 2)))


def test_offsets_are_bilinear_between_nodes_and_those_of_the_rim_beyond():
    one = field()
    points = np.random.default_rng(1).uniform(-4.0, 10.0, (200, 2))
    nodes, weights = _bilinear(points, one.corner, one.spacing_m, one.offsets.shape[:2])
    plain = (weights[..., None] * one.offsets.reshape(-1, 2)[nodes]).sum(axis=1)
    np.testing.assert_allclose(one.at(points), plain, atol=1e-12)
    np.testing.assert_allclose(weights.sum(axis=1), 1.0)
    np.testing.assert_allclose(one.at(np.array([[0.5, 2.0]]))[0], one.offsets[0, 1])


@pytest.mark.parametrize("shape", [(1, 1), (1, 4), (3, 1)])
def test_grids_of_one_row_or_column_have_offsets_too(shape):
    one = OffsetField((0.0, 0.0), 1.0, np.random.default_rng(2).normal(size=(*shape, 2)))
    points = np.random.default_rng(3).uniform(-1.0, 5.0, (50, 2))
    nodes, weights = _bilinear(points, one.corner, 1.0, shape)
    plain = (weights[..., None] * one.offsets.reshape(-1, 2)[nodes]).sum(axis=1)
    np.testing.assert_allclose(one.at(points), plain, atol=1e-12)


def test_what_is_bent_is_unbent_to_a_millimetre():
    one, motion = field(), Transform(3.0, -2.0, 0.7)
    points = np.random.default_rng(4).uniform(0.0, 6.0, (100, 2))
    np.testing.assert_allclose(one.unbent(motion, one.bent(motion, points)), points, atol=1e-3)
