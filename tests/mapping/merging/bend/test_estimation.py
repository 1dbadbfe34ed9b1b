"""How much maps are bent against each other is estimated from both."""

import math

import numpy as np
import pytest
from drawn_maps import RESOLUTION, about_middle, apartment, bowed, hall, moved, sagging

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.merging.bend.bent_agreement import compare_bent, tolerance
from lidarium.mapping.merging.bend.estimation import BendSettings, _solved, estimate_bend
from lidarium.mapping.merging.bend.offset_field import bilinear
from lidarium.mapping.merging.description.described_map import describe_map
from lidarium.mapping.merging.pair import described, merge_pair
from lidarium.mapping.merging.settings import MergeSettings


def test_offsets_solve_the_plain_normal_equations():
    generator = np.random.default_rng(5)
    columns, rows, stiffness = 5, 4, 0.3
    count = columns * rows
    points = generator.random((60, 2)) * (columns - 1, rows - 1)
    nodes, weights = bilinear(points, (0.0, 0.0), 1.0, (rows, columns))
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
    assert tolerance(bend, RESOLUTION)[0] < 0.1
    agreement = compare_bent(a, b, bend)
    assert agreement.hit_rate > 0.95
    assert agreement.contradicting_m < 0.2
    deviations = np.sqrt(np.linalg.eigvalsh(bend.covariance))
    assert 1e-5 < deviations[0] <= deviations[-1] < 0.05


def test_maps_that_do_not_meet_have_no_bend():
    a, b = (describe_map(levels, RESOLUTION) for levels in (apartment(), apartment()))
    bend = estimate_bend(a, b, Transform(500.0, 0.0, 0.0), BendSettings())
    assert not bend.is_held
    assert bend.bend_m == 0.0
    assert compare_bent(a, b, bend).overlap_m2 == 0.0
