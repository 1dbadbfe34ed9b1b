"""Many episodes in one simulation: each goes as it would alone, to the bit, however many threads drive it."""

import copy

import numpy as np
import pytest
from driven_teams import FLOORS, HALL, ROBOTS, SEEDS, Teams

from lidarium.envs.onboard.driving.drives import (
    STATE_ARRIVED,
    STATE_GIVING_WAY,
)
from lidarium.envs.onboard.radio.messages import Orders, Target
from lidarium.envs.simulation.kernels.floor_cache import FloorTables


def of_team(log, episode):
    return [rows[episode * ROBOTS : (episode + 1) * ROBOTS] for rows in log]


@pytest.mark.parametrize("threads", [1, 2])
def test_episodes_driven_together_drive_as_each_does_alone(threads):
    together = Teams(FLOORS, SEEDS, threads).driven_to_targets(35)
    numbers = [row[0] for rows in together for row in rows]
    assert STATE_GIVING_WAY in numbers
    assert STATE_ARRIVED in numbers
    for episode, (floor, seed) in enumerate(zip(FLOORS, SEEDS, strict=True)):
        assert of_team(together, episode) == Teams((floor,), (seed,)).driven_to_targets(35)


@pytest.mark.parametrize("known_starts", [True, False])
@pytest.mark.parametrize("threads", [1, 2])
def test_episodes_explored_together_are_offered_what_each_is_alone(threads, known_starts):
    together = Teams(FLOORS[:3], SEEDS[:3], threads, known_starts).explored(12)
    assert max(row[3] for row in together[0]) >= 2
    for episode, (floor, seed) in enumerate(zip(FLOORS[:3], SEEDS[:3], strict=True)):
        assert of_team(together, episode) == Teams((floor,), (seed,), 1, known_starts).explored(12)


def test_only_the_episodes_named_are_prepared():
    teams = Teams(FLOORS[:3], SEEDS[:3])
    teams.driver.assign(teams.every, Orders.of([Target(0.4, 0.0)] * teams.rows))
    teams.driver.prepare(np.array([1]))
    assert teams.driver.drives.has_path.tolist() == [False, False, True, True, False, False]


def test_a_new_episode_beside_others_leaves_them_as_they_are():
    one, other = Teams(FLOORS[:2], SEEDS[:2]), Teams(FLOORS[:2], SEEDS[:2])
    one.explored(3)
    other.explored(3)
    old_map = one.perception.shared_map(0)
    tables = FloorTables.of_floor(HALL, 0.025, one.settings.lidar.height, one.settings.robot.height)
    one.simulation.place(0, tables, HALL.starts, 9)
    one.perception.start(None, 0)
    one.driver.start(0)
    one.offers.start(0)
    assert one.driver.states()[:ROBOTS].tolist() == [0, 0]
    assert one.perception.shared_map(0) is not old_map
    assert len(old_map.frontiers) > 0
    assert of_team(one.explored(3), 1) == of_team(other.explored(3), 1)


def test_a_copy_of_running_teams_goes_on_as_they_do():
    teams = Teams(FLOORS[:2], SEEDS[:2])
    teams.explored(3)
    twin = copy.deepcopy(teams)
    assert teams.explored(4) == twin.explored(4)
