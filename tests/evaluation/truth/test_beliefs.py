"""What the robots' maps say, on the lattice of the floor."""

import numpy as np
import pytest
from seen_truth import NEAR, begun

from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.settings.making import make_settings
from lidarium.envs.simulation.maps_on_floor import cells_beyond
from lidarium.evaluation.truth.beliefs import (
    believed_on_floor,
    free_as_held,
    map_within,
    maps_on_floor,
    shares_one_map,
    team_log_odds,
)


def test_the_team_map_is_the_same_wherever_the_robots_believe_to_start():
    turned = {"starts": np.array([(2.5, 4.0, 0.0), (8.4, 6.3, np.pi / 2)])}
    maps = []
    for known_starts in (True, False):
        env = ExplorationEnv("apartment", make_settings(robots=2, resolution=0.05, known_starts=known_starts))
        env.reset(seed=0, options=turned)
        maps.append(np.sign(team_log_odds(env)[0]))
    known, unknown = maps
    either = (known != 0) | (unknown != 0)
    assert (known == unknown)[either].mean() > 0.9


@pytest.mark.parametrize("known_starts", [True, False])
def test_a_window_of_a_map_is_that_part_of_the_whole(known_starts):
    env = begun(known_starts=known_starts)
    whole = maps_on_floor(env)
    rows, columns = slice(30, 90), slice(40, 131)
    for row in range(2):
        assert np.array_equal(map_within(env, row, rows, columns), whole[row, rows, columns])
    assert (whole != 0).any(axis=(1, 2)).all()
    assert np.array_equal(team_log_odds(env)[0], whole.sum(axis=0, dtype=np.int16))


def test_a_map_that_knows_its_start_is_moved_by_whole_cells():
    env = begun()
    row, column = cells_beyond(env.simulation, 0, 0)
    marked = env.beliefs.log_odds[0]
    marked[row + 3, column + 7] = 99
    assert np.argwhere(maps_on_floor(env)[0] == 99).tolist() == [[3, 7]]


@pytest.mark.parametrize("known_starts", [True, False])
def test_believed_poses_lie_on_the_floor(known_starts):
    env = begun(known_starts=known_starts)
    assert believed_on_floor(env) == pytest.approx(NEAR)
    env.beliefs.believed[1, 0] += 0.5
    moved = believed_on_floor(env)[1, :2] - NEAR[1, :2]
    heading = 0.0 if known_starts else NEAR[1, 2]
    assert moved == pytest.approx([0.5 * np.cos(heading), 0.5 * np.sin(heading)])


def test_robots_that_share_one_map_hold_its_sum_to_be_free():
    env, alone = begun(), begun(known_starts=False)
    assert (shares_one_map(env), shares_one_map(alone), shares_one_map(begun(NEAR[:1]))) == (
        True,
        False,
        False,
    )
    maps = np.array([[[-3, -1, 0]], [[2, 2, -1]]], np.int8)
    assert free_as_held(env, maps).tolist() == [[[True, False, True]]] * 2
    assert free_as_held(alone, maps).tolist() == [[[True, True, False]], [[False, False, True]]]
