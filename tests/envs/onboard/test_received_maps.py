"""Robots that do not know their starts are told what others know: they plan and explore on that as on
their own map."""

import numpy as np
import pytest

from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.onboard.radio.messages import DriveState, Target
from lidarium.envs.settings.making import make_settings
from lidarium.mapping.merging.fusion import FusedMap
from lidarium.mapping.planning.frontiers.frontier_map import FRONTIER, IGNORED

RESOLUTION = 0.05


def known(rows, columns, origin, level=255):
    levels = np.full((rows, columns), level, np.uint8)
    return FusedMap(
        levels,
        np.zeros((rows, columns), np.float32),
        np.zeros((rows, columns), np.uint64),
        origin,
        RESOLUTION,
    )


@pytest.fixture
def env():
    environment = ExplorationEnv("apartment", make_settings(robots=2, known_starts=False))
    environment.reset(seed=0)
    return environment


def cell(belief, x, y):
    origin = belief.map_origin
    return int(np.floor((y - origin[1]) / RESOLUTION)), int(np.floor((x - origin[0]) / RESOLUTION))


def test_a_robot_that_has_received_a_map_has_the_sum_of_both_maps_and_its_teammate_its_own(env):
    perception, belief = env.perception, env.belief("robot_0")
    assert belief.shared_map is None
    perception.received.receive(0, known(20, 30, (9.0, -9.0)))
    assert belief.shared_map.log_odds[cell(belief, 9.5, -8.5)] < 0
    assert belief.map.log_odds[cell(belief, 9.5, -8.5)] == 0
    beside = np.ones(belief.map.log_odds.shape, bool)
    row, column = cell(belief, 9.0 + 1e-6, -9.0 + 1e-6)
    beside[row : row + 20, column : column + 30] = False
    assert (belief.shared_map.log_odds[beside] == belief.map.log_odds[beside]).all()
    assert env.belief("robot_1").shared_map is None


def test_what_is_received_takes_the_place_of_what_was_received_before_and_can_be_taken_back(env):
    perception, belief = env.perception, env.belief("robot_0")
    perception.received.receive(0, known(20, 30, (9.0, -9.0)))
    shared = belief.shared_map
    assert shared.frontiers.flags[cell(belief, 9.0 + 1e-6, -8.5)] == FRONTIER
    perception.received.receive(0, known(20, 30, (10.0, -9.0)))
    assert shared.log_odds[cell(belief, 9.5, -8.5)] == 0
    assert shared.log_odds[cell(belief, 11.4, -8.5)] < 0
    perception.received.receive(0, None)
    assert (belief.shared_map.log_odds == belief.map.log_odds).all()


def test_the_own_scans_go_on_to_change_the_sum(env):
    perception, belief = env.perception, env.belief("robot_0")
    perception.received.receive(0, known(20, 30, (9.0, -9.0), 0))
    _ = belief.shared_map
    for _ in range(30):
        env.step({agent: np.array([0.3, 0.6], np.float32) for agent in env.agents})
    own, shared = belief.map.log_odds, belief.shared_map.log_odds
    assert np.count_nonzero(shared) == np.count_nonzero(own) + 600
    assert (shared[own != 0] == own[own != 0]).all()


def test_a_robot_drives_over_what_it_only_knows_from_others():
    env = ExplorationEnv("scene_loop", make_settings(robots=2, known_starts=False))
    world = env
    env.use_level("waypoint")
    world.reset(seed=0)
    log_odds = env.perception.own_map(0).log_odds
    free = np.argwhere(log_odds < 0)
    belief = env.belief("robot_0")
    origin, pose = belief.map_origin, belief.pose
    # A lane of free cells from where the robot stands towards the unknown at its back.
    env.perception.received.receive(
        0, known(24, 80, (float(np.round(pose[0] - 3.0, 2)), float(np.round(pose[1] - 0.6, 2))))
    )
    behind = Target(float(pose[0] - 1.0), float(pose[1]))
    assert len(free) > 0
    assert log_odds[cell(belief, behind.x, behind.y)] == 0, (origin, pose)
    for _ in range(6):
        world.step({"robot_0": behind, "robot_1": None})
    assert world.drive_state("robot_0") in (DriveState.ARRIVED, DriveState.DRIVING, DriveState.BLOCKED)
    assert float(env.world.travelled[0]) > 0.3
    assert float(env.world.travelled[1]) == 0.0


def test_frontiers_that_were_given_up_stay_given_up_when_a_robot_receives_more(env):
    belief = env.belief("robot_0")
    frontiers = belief.map.frontiers
    first = frontiers.cells()[0]
    frontiers.ignore(first[None])
    env.perception.received.receive(0, known(2, 2, (9.0, -9.0)))
    assert belief.shared_map.frontiers.flags[tuple(first)] == IGNORED


def test_maps_of_other_cells_and_teams_with_known_starts_are_refused(env):
    with pytest.raises(ValueError, match=r"0\.1 m"):
        env.perception.received.receive(0, FusedMap(*[np.zeros((1, 1))] * 3, (0.0, 0.0), 0.1))
    knowing = ExplorationEnv("apartment", make_settings(robots=2))
    knowing.reset(seed=0)
    with pytest.raises(ValueError, match="unknown starts"):
        knowing.perception.received.receive(0, None)
