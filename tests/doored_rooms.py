"""Two rooms with a door between them, and a robot in the left one."""

import numpy as np

from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.floors.floor import Floor, Solid
from lidarium.envs.settings.making import make_settings
from lidarium.envs.simulation.kernels.arrays import DOOR_HOLD, DOOR_KIND, DOOR_OPEN, OPENS


def wall(x, low, high):
    return Solid(np.array([(x - 0.05, low), (x + 0.05, low), (x + 0.05, high), (x - 0.05, high)]))


ROOMS = Floor("rooms", (0.0, 0.0, 8.0, 4.0), (wall(4.0, 0.0, 1.5), wall(4.0, 2.4, 4.0)))
START = {"starts": [(1.0, 1.95, 0.0)]}


def robot_at_door(kind=OPENS, **options):
    """A robot in the left one of two rooms, with a door of a kind between them."""
    settings = make_settings(**{"robots": 1, "doors": 1.0, "horizon_s": 60.0, "resolution": 0.05, **options})
    env = ExplorationEnv(ROOMS, settings)
    env.reset(seed=0, options=START)
    door = env.simulation.population.doors_of(0)[0]
    door[DOOR_KIND], door[DOOR_OPEN], door[DOOR_HOLD] = kind, 0.0, 0.0
    return env, door
