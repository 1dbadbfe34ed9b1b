"""A scan's pose is sought around odometry, in steps of a cell."""

import math

import numpy as np
import pytest
from driven_rooms import cast, odd_room
from mapped_room import ORIGIN, odd_room_submap, points_of

from lidarium.mapping.geometry.rigid import composed
from lidarium.mapping.localization.matching.scan_search import angle_step, search
from lidarium.mapping.localization.matching.submaps import UNSEEN, AgreementGrid

NOTHING_KNOWN = np.zeros((3, 3))


@pytest.fixture(scope="module")
def submap():
    """The odd room as seen from places around its middle."""
    return odd_room_submap()


def test_of_poses_that_fit_alike_the_search_takes_the_one_that_odometry_expects(submap):
    points = points_of(cast(odd_room(), ORIGIN))
    expected = np.array([0.1, -0.05, 0.0])
    sure, unsure = np.diag([1e6, 1e6, 1e6]), NOTHING_KNOWN
    assert search(submap.grid, points, expected, 0.2, 0.05, sure, 500.0, 0.3) == pytest.approx(expected)
    found = search(submap.grid, points, expected, 0.2, 0.05, unsure, 500.0, 0.3)
    assert np.hypot(*found[:2]) < 0.06


def plain_cost(grid, points, pose, around, information, weight, unseen):
    """The cost of a pose by its definition, cell by cell."""
    cosine, sine = math.cos(pose[2]), math.sin(pose[2])
    total = 0.0
    for x, y in points.tolist():
        column = math.floor((cosine * x - sine * y + pose[0]) / grid.resolution + 1e-9) - grid.column
        row = math.floor((sine * x + cosine * y + pose[1]) / grid.resolution + 1e-9) - grid.row
        level = int(grid.levels[row, column])
        total += unseen if level == UNSEEN else (1.0 - level / 255.0) ** 2
    away = np.asarray(pose) - around
    return weight * total / len(points) + away @ information @ away


@pytest.mark.parametrize("known", [0.0, 200.0])
def test_no_pose_of_the_window_costs_less_than_the_one_that_is_found(submap, known):
    points = points_of(cast(odd_room(), composed(ORIGIN, np.array([0.07, -0.04, 0.03]))))[::9]
    around, information = np.zeros(3), known * np.eye(3)
    found = search(submap.grid, points, around, 0.1, 0.04, information, 50.0, 0.3)
    step, side = angle_step(points, 0.05), 0.05
    costs = [
        plain_cost(submap.grid, points, (j * side, i * side, k * step), around, information, 50.0, 0.3)
        for k in range(-math.ceil(0.04 / step), math.ceil(0.04 / step) + 1)
        for i in range(-2, 3)
        for j in range(-2, 3)
    ]
    # Squares are counted in parts of 255.
    there = plain_cost(submap.grid, points, found, around, information, 50.0, 0.3)
    assert there == pytest.approx(min(costs), abs=50.0 / 255.0)
    assert min(costs) < np.median(costs) - 1.0


def test_a_window_beyond_the_map_is_unseen_everywhere():
    grid = AgreementGrid(np.full((20, 20), 255, np.uint8), 0, 0, 0.05)
    points = np.array([[0.1, 0.0], [0.2, 0.1], [0.3, 0.2]])
    far = np.array([50.0, -20.0, 0.3])
    found = search(grid, points, far, 0.1, 0.05, np.eye(3), 10.0, 0.3)
    np.testing.assert_array_equal(found, far)


def test_an_angle_step_moves_far_points_by_a_cell_within_limits():
    ring = 3.0 * np.stack([np.cos(np.arange(50)), np.sin(np.arange(50))], axis=1)
    assert angle_step(ring, 0.06) == pytest.approx(0.02)
    assert angle_step(100.0 * ring, 0.06) == pytest.approx(math.radians(0.25))
    assert angle_step(0.01 * ring, 0.06) == pytest.approx(math.radians(2.0))
    assert angle_step(np.zeros((0, 2)), 0.06) == pytest.approx(math.radians(1.0))
    # A single return far away sets no step.
    assert angle_step(np.vstack([ring, [[500.0, 0.0]]]), 0.06) == pytest.approx(0.02)


def test_a_search_without_reach_stays(submap):
    points = points_of(cast(odd_room(), ORIGIN))
    around = np.array([0.3, 0.2, 0.1])
    assert search(submap.grid, points, around, 0.0, 0.0, NOTHING_KNOWN, 500.0, 0.3) is around
