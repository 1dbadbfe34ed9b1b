"""Teams in a plain hall, and what they score."""

import math

import numpy as np

from lidarium.envs.engine.tally import Tally
from lidarium.envs.floors.floor import Raster
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.settings.lidar import Lidar
from lidarium.envs.settings.robots import ROBOTS
from lidarium.envs.simulation.kernels.contact import distance_bound
from lidarium.envs.simulation.kernels.floor_cache import FloorTables
from lidarium.envs.simulation.kernels.ray_tables import RayTables
from lidarium.envs.simulation.kinematic_simulation import KinematicSimulation
from lidarium.envs.simulation.rewards import reward_weights
from lidarium.mapping.grids.occupancy import OccupancySettings


def tables_of(solid, resolution=0.025):
    raster = Raster(solid.astype(np.uint8), (0.0, 0.0), resolution)
    return FloorTables(raster, raster, RayTables(raster.solid), distance_bound(raster.solid))


def hall(rows=160, columns=240):
    solid = np.zeros((rows, columns), np.uint8)
    solid[0], solid[-1], solid[:, 0], solid[:, -1] = 1, 1, 1, 1
    return solid


def team(robots, resolution=0.05, beams=181, noise=0.0, weights=None):
    lidar, maps = Lidar(beams=beams, noise_floor=noise), OccupancySettings(resolution=resolution)
    return KinematicSimulation.of_team([ROBOTS["kobuki"]] * robots, lidar, maps, reward_weights=weights)


def scored(weights, robots=2):
    options = ExplorationSettings(robots=robots, reward=weights)
    simulation = team(robots, weights=reward_weights(options))
    simulation.place(0, tables_of(hall()), np.array([[1.0, 2.0, 0.0], [3.0, 2.0, math.pi]])[:robots], 1)
    scorer = Tally(simulation, options)
    simulation.step(np.zeros((robots, 2)), moves_bodies=False)
    scorer.start()
    return simulation, scorer
