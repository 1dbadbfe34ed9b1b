"""Teams of many episodes with their onboard software and drivers."""

import math

import numpy as np

from lidarium.envs.floors.floor import Floor, Solid
from lidarium.envs.levels.frontier import FrontierOffers
from lidarium.envs.onboard.driving.team_driver import TeamDriver
from lidarium.envs.onboard.perception import Perception
from lidarium.envs.onboard.radio.messages import Orders, Target
from lidarium.envs.settings.making import make_settings
from lidarium.envs.simulation.kernels.floor_cache import FloorTables
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
        orders = Orders.of([Target(*(place - offset)) for place, offset in zip(targets, self.offsets, strict=True)])
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
