"""Maps of a team are laid over each other where they are true, with the frontiers of what is known."""

import cv2
import numpy as np
import pytest

import lidarium
from lidarium.envs.drawing.frame_parts import EXPLORED, UNEXPLORED, WALL, pale, team_colours
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.settings.making import make_settings
from lidarium.evaluation.episodes.runner import run_episode
from lidarium.evaluation.truth.true_map import truth_of
from lidarium.evaluation.viewing.maps import TeamMaps


@pytest.fixture(scope="module")
def env():
    settings = make_settings(robots=2, horizon_s=15.0, resolution=0.05, known_starts=False)
    env = ExplorationEnv("apartment", settings)
    run_episode(lidarium.policy("nearest_frontier_own_map"), env, 1)
    return env


def test_what_robots_hold_to_be_free_is_free_on_the_floor(env):
    maps = TeamMaps(env)
    occupied = truth_of(env).occupied
    (x, y), (left, low) = maps.corner, env.world.floors[0].laser.origin
    row, column = round((y - low) / maps.cell_m), round((x - left) / maps.cell_m)
    for levels in maps.levels(env, [{0}, {1}]):
        true = occupied[row : row + levels.shape[0], column : column + levels.shape[1]]
        assert (levels < 0).sum() > 500
        assert (true & (levels < 0)).sum() < 0.02 * (levels < 0).sum()
        within_a_cell = cv2.dilate(true.view(np.uint8), np.ones((3, 3), np.uint8)) != 0
        assert (within_a_cell & (levels > 0)).sum() > 0.98 * (levels > 0).sum()


def test_a_joined_map_knows_what_its_robots_do(env):
    maps = TeamMaps(env)
    one, other = maps.levels(env, [{0}, {1}])
    (both,) = maps.levels(env, [{0, 1}])
    assert ((both != 0) <= ((one != 0) | (other != 0))).all()
    assert (both < 0).sum() > max((one < 0).sum(), (other < 0).sum())


def test_frontiers_are_free_cells_beside_unknown_ones(env):
    maps = TeamMaps(env)
    (levels,) = found = maps.levels(env, [{0, 1}])
    frontiers = maps.frontiers(found)
    assert len(frontiers) > 20
    for x, y in frontiers:
        row, column = int((y - maps.corner[1]) / maps.cell_m), int((x - maps.corner[0]) / maps.cell_m)
        assert levels[row, column] < 0
        around = (
            levels[max(row - 1, 0) : row + 2, column],
            levels[row, max(column - 1, 0) : column + 2],
        )
        assert any((side == 0).any() for side in around)
    assert maps.frontiers([]).shape == (0, 2)


def test_a_picture_shows_whose_map_it_is(env):
    maps = TeamMaps(env)
    blue, orange = team_colours(2)

    def colours(groups):
        picture = maps.picture(groups, maps.levels(env, groups))
        return {tuple(colour) for colour in np.unique(picture.reshape(-1, 3), axis=0).tolist()}

    assert colours([]) == {UNEXPLORED}
    assert colours([{0, 1}]) == {UNEXPLORED, WALL, EXPLORED}
    assert colours([{0}]) == {UNEXPLORED, blue, pale(blue)}
    assert colours([{1}]) == {UNEXPLORED, orange, pale(orange)}
