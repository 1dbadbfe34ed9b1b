"""Requests, collisions and shortest paths in furnished places are what geometry says."""

import numpy as np
import pytest

from lidarium.benchmarks.studies.sparse.grids import laser_grid
from lidarium.benchmarks.studies.sparse.paths import ShortestPaths
from lidarium.benchmarks.studies.sparse.places import (
    BODY,
    CAMERA,
    CELL_M,
    CLEAR_M,
    Place,
    frames_of,
    load_place,
    requests_of,
    stops_of,
)
from lidarium.envs.floors.catalogue.names import load_floor
from lidarium.envs.floors.floor import Floor, Solid
from lidarium.mapping.sparse.planning import points_along


@pytest.fixture(scope="module")
def arena():
    return load_place("home_arena")


def one_block(tmp_path=None):
    """A place of 6 x 4 m with a block of 1 m in its middle, whose corners are known."""
    from scipy import ndimage

    block = Solid(np.array([[2.5, 1.5], [3.5, 1.5], [3.5, 2.5], [2.5, 2.5]]), z_high=1.0)
    walls = [
        Solid(np.array([[x, y], [x + w, y], [x + w, y + h], [x, y + h]]), z_high=2.5)
        for x, y, w, h in ((0, 0, 6, 0.1), (0, 3.9, 6, 0.1), (0, 0.1, 0.1, 3.8), (5.9, 0.1, 0.1, 3.8))
    ]
    floor = Floor("block", (0.0, 0.0, 6.0, 4.0), (block, *walls), None, np.array([[1.0, 2.0, 0.0]]), None)
    raster = floor.raster(CELL_M, BODY.clearance, BODY.height)
    gaps = ndimage.distance_transform_edt(raster.solid == 0) * CELL_M
    return Place("block", floor, np.array(raster.origin), gaps.astype(np.float32), gaps > BODY.radius)


def test_requests_are_clear_and_within_reach(arena):
    requests = requests_of(arena)
    assert requests.shape == (1000, 2, 2)
    assert arena.gaps_at(requests.reshape(-1, 2)).min() > BODY.radius + CLEAR_M
    assert np.array_equal(requests, requests_of(arena))


def test_a_path_collides_where_the_body_reaches_into_a_solid():
    place = one_block()
    passing = 1.5 - BODY.radius
    assert not place.collides(np.array([[1.0, passing - 0.02, 0.0], [5.0, passing - 0.02, 0.0]]))
    assert place.collides(np.array([[1.0, passing + 0.03, 0.0], [5.0, passing + 0.03, 0.0]]))
    assert place.collides(np.array([[1.0, 2.0, 0.0], [5.0, 2.0, 0.0]]))


def test_the_shortest_path_around_a_block_is_two_tangents_and_arcs():
    place = one_block()
    start, goal = np.array([1.0, 2.0]), np.array([5.0, 2.0])
    found = ShortestPaths(place).lengths(np.array([[start, goal], [start, [1.0, 3.0]]]))
    # A tangent to the circle about a corner, the arc there, the straight piece above the block.
    gap = np.array([1.5, 0.5])
    straight = np.sqrt(gap @ gap - BODY.radius**2)
    turn = np.arctan2(gap[1], gap[0]) + np.arcsin(BODY.radius / np.hypot(*gap))
    assert found[0] == pytest.approx(2.0 * (straight + BODY.radius * turn) + 1.0, rel=2e-3)
    assert found[1] == pytest.approx(1.0)


def test_no_path_is_shorter_than_the_optimum_and_the_grid_finds_one(arena):
    requests = requests_of(arena)[:40]
    best, grid = ShortestPaths(arena).lengths(requests), laser_grid(arena)
    for (start, goal), shortest in zip(requests, best, strict=True):
        assert shortest >= np.linalg.norm(goal - start) - 1e-9
        path = grid.plan(start, goal)
        if path is not None and not arena.collides(path):
            length = np.linalg.norm(np.diff(path, axis=0), axis=1).sum()
            assert length >= shortest - 0.02


def test_frames_of_a_survey_see_the_floor_and_what_stands_there():
    place = load_place("home_arena")
    stops = stops_of(place)
    assert place.gaps_at(stops).min() > BODY.radius
    frame = next(frames_of(place))
    heights = frame.in_map[:, 2]
    assert heights.min() == pytest.approx(0.0, abs=1e-3)
    assert heights.max() < 2.6
    assert len(frame.points) > 0.5 * CAMERA.rows * CAMERA.columns


def test_a_laser_misses_tops_at_which_a_body_cannot_stand():
    place = load_place("robotics_laboratory")
    grid = laser_grid(place)
    # Under the middle of the meeting table.
    under = np.array([[3.6, 3.7]])
    assert place.gaps_at(under)[0] == 0.0
    assert grid.log_odds.shape == load_floor("robotics_laboratory").raster(0.05, 0.3, 0.3).solid.shape
    assert not grid.are_blocked(under).any()


def test_points_along_a_path_are_close():
    path = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    assert len(points_along(path, 0.005)) == 201
