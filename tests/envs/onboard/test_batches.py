"""Many episodes in one simulation: each goes as it would alone, to the bit, however many threads drive it."""

import copy
import math

import numpy as np
import pytest

from lidarium.envs.driving.drives import (
    STATE_ARRIVED,
    STATE_GIVING_WAY,
    any_newly_done,
    is_done,
    mark_waiting,
)
from lidarium.envs.driving.team_driver import TeamDriver
from lidarium.envs.floors.floor import Floor, Solid
from lidarium.envs.levels.frontier_offers import REASONS, FrontierOffers
from lidarium.envs.onboard.navigation import FLAGS
from lidarium.envs.onboard.perception import Perception
from lidarium.envs.radio.messages import Orders, Target
from lidarium.envs.settings.making import make_settings
from lidarium.envs.simulation.kernels.arrays import ENDED
from lidarium.envs.simulation.kernels.floor_tables import FloorTables
from lidarium.envs.simulation.kinematic_simulation import KinematicSimulation

ROBOTS = 2


def wall(x, y, width, height):
    return Solid(np.array([[x, y], [x + width, y], [x + width, y + height], [x, y + height]]))


CORRIDOR = Floor(
    "corridor",
    (0.0, 0.0, 8.0, 3.0),
    (wall(1.6, 0.0, 4.8, 1.2), wall(1.6, 1.8, 2.0, 2.0), wall(4.2, 1.8, 2.2, 2.0), wall(3.4, 2.4, 1.0, 1.0)),
    starts=np.array([[0.9, 1.5, 0.0], [7.1, 1.5, math.pi]]),
)
ROOMS = Floor(
    "rooms",
    (0.0, 0.0, 7.0, 4.0),
    (wall(3.4, 0.0, 0.2, 1.5), wall(3.4, 2.5, 0.2, 1.5)),
    starts=np.array([[1.0, 1.0, 0.5], [1.0, 3.0, -0.5]]),
)
HALL = Floor(
    "hall",
    (0.0, 0.0, 6.0, 5.0),
    (wall(3.8, 3.0, 0.4, 0.4),),
    starts=np.array([[1.0, 2.5, 0.0], [3.0, 0.5, math.pi / 2]]),
)
FLOORS = (CORRIDOR, ROOMS, HALL, CORRIDOR, ROOMS)
SEEDS = (3, 4, 5, 6, 7)
TARGETS = {
    "corridor": [(7.1, 1.5), (0.9, 1.5)],
    "rooms": [(6.0, 2.0), (5.0, 3.4)],
    "hall": [(5.0, 2.5), (3.0, 4.5)],
}


class Teams:
    """Episodes on floors with their onboard software."""

    def __init__(self, floors, seeds, threads=1, known_starts=True):
        self.settings = make_settings(
            robots=ROBOTS,
            lidar="lidar_360_6m",
            noise="datasheet",
            known_starts=known_starts,
            threads=threads,
            stop_coverage=None,
        )
        settings, self.episodes = self.settings, len(floors)
        self.rows = self.episodes * ROBOTS
        self.simulation = KinematicSimulation.of_team(
            [settings.robot] * ROBOTS,
            settings.lidar,
            settings.occupancy,
            settings.time_step,
            self.episodes,
            threads=settings.threads,
        )
        self.offsets = np.zeros((self.rows, 2))
        self.perception = Perception(self.simulation, settings, self.offsets)
        self.driver = TeamDriver(self.perception, settings)
        self.offers = FrontierOffers(self.perception, settings, self.driver)
        for episode, (floor, seed) in enumerate(zip(floors, seeds, strict=True)):
            tables = FloorTables.of_floor(
                floor, settings.raster_resolution, settings.lidar.height, settings.robot.height
            )
            self.simulation.place(episode, tables, floor.starts, seed, known_starts)
            if known_starts:
                self.offsets[episode * ROBOTS : (episode + 1) * ROBOTS] = floor.starts[:, :2]
        self.simulation.step(np.zeros((self.rows, 2)), moves_bodies=False)
        for episode in range(self.episodes):
            self.perception.start(None, episode)
            self.driver.start(episode)
            self.offers.start(episode)
        self.every = np.ones(self.rows, np.bool_)
        self.floors, self.seeds = floors, seeds

    def drive(self, orders, steps=20):
        """Run a decision; return all that it did, row by row."""
        driver, drives = self.driver, self.driver.drives
        driver.assign(self.every, orders)
        driver.prepare()
        commands = []
        for _ in range(steps):
            commands.append(driver.commands().copy())
            self.simulation.step(commands[-1])
        states, commands = driver.states(), np.array(commands)
        return [
            (
                states[row],
                drives.counts[row],
                drives.places[row],
                drives.paths[row, : drives.counts[row]].tobytes(),
                drives.room[row, : drives.counts[row]].tobytes(),
                commands[:, row].tobytes(),
                self.simulation.world.poses[row].tobytes(),
            )
            for row in range(self.rows)
        ]

    def driven_to_targets(self, decisions):
        targets = [np.array(place) for floor in self.floors for place in TARGETS[floor.name]]
        orders = Orders.of(
            [Target(*(place - offset)) for place, offset in zip(targets, self.offsets, strict=True)]
        )
        return [self.drive(orders) for _ in range(decisions)]

    def explored(self, decisions):
        generators = [np.random.default_rng(seed) for seed in self.seeds]
        offers, log = self.offers.offers, []
        reasons = self.offers.renew(self.every, self.every)
        for _ in range(decisions):
            log.append(
                [
                    (
                        reasons[row],
                        offers.tables[row].tobytes(),
                        offers.masks[row].tobytes(),
                        offers.counts[row],
                        *(
                            part[row, : offers.counts[row]].tobytes()
                            for part in (offers.targets, offers.headings, offers.cells)
                        ),
                    )
                    for row in range(self.rows)
                ]
            )
            numbers = np.concatenate([generator.integers(0, 8, ROBOTS) for generator in generators])
            log.append(self.drive(self.offers.choose(self.every, numbers)))
            reasons = self.offers.renew(self.every, self.every)
        return log


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


def test_driving_by_waypoints_keeps_no_frontiers():
    teams = Teams(FLOORS[:2], SEEDS[:2])
    teams.driven_to_targets(2)
    assert not teams.driver.planning(np.arange(teams.rows)).records[:, FLAGS].any()
    assert teams.driver.planning(np.arange(teams.rows), with_frontiers=True).records[:, FLAGS].all()


def test_the_same_order_again_changes_nothing_and_a_new_one_drops_the_path():
    teams = Teams((HALL,), (1,))
    drives, target = teams.driver.drives, Target(2.0, 0.5, 1.0)
    teams.drive(Orders.of([target, None]), steps=3)
    assert drives.has_path.tolist() == [True, False]
    teams.driver.assign(teams.every, Orders.of([target, None]))
    assert drives.has_path[0]
    teams.driver.assign(np.array([False, True]), Orders.of([None, None]))
    assert drives.is_ordered[0]
    for changed in (Target(2.0, 0.5), Target(2.0, 0.6, 1.0), None):
        teams.drive(Orders.of([target, None]), steps=1)
        assert drives.has_path[0]
        teams.driver.assign(teams.every, Orders.of([changed, None]))
        assert not drives.has_path[0]
        assert drives.is_ordered[0] == (changed is not None)


def test_a_robot_is_newly_done_when_it_waits_and_did_not_before():
    teams = Teams((HALL,), (1,))
    drives, waiting, live = teams.driver.drives, np.zeros(ROBOTS, np.bool_), np.ones(ROBOTS, np.bool_)
    teams.driver.assign(teams.every, Orders.of([Target(0.1, 0.0), Target(-100.0, 0.0)]))
    teams.driver.prepare()
    mark_waiting(drives, 0, ROBOTS, waiting)
    assert waiting.tolist() == [False, True]
    assert not any_newly_done(drives, 0, ROBOTS, live, waiting)
    teams.drive(Orders.of([Target(0.1, 0.0), Target(-100.0, 0.0)]))
    assert is_done(drives, 0)
    assert any_newly_done(drives, 0, ROBOTS, live, waiting)
    assert not any_newly_done(drives, 0, ROBOTS, np.array([False, True]), waiting)


def test_robots_that_have_ended_are_not_planned_for():
    teams = Teams((HALL,), (1,))
    teams.simulation.world.flags[0] |= ENDED
    teams.driver.assign(teams.every, Orders.of([Target(1.0, 0.0)] * ROBOTS))
    teams.driver.prepare()
    assert teams.driver.drives.has_path.tolist() == [False, True]


def test_what_is_not_offered_lets_a_robot_stay():
    teams = Teams((ROOMS,), (1,))
    assert not teams.offers.renew(teams.every, teams.every).any()
    orders = teams.offers.choose(teams.every, np.array([0, 16]))
    assert orders.is_ordered.tolist() == [True, False]
    chosen = teams.offers.target(0)
    assert (chosen.x, chosen.y) == tuple(teams.offers.offers.targets[0, 0])
    assert REASONS[0] == ""
