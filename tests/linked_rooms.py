"""A room, and two with a door between them, for teams that know the floor."""

import numpy as np

from lidarium.envs.floors.floor import Floor, Solid
from lidarium.envs.settings.making import make_settings


def wall(x, y, width, height):
    return Solid(np.array([[x, y], [x + width, y], [x + width, y + height], [x, y + height]]))


ROOM = Floor("room", (0.0, 0.0, 4.0, 3.0), (), starts=np.array([[2.0, 1.5, 0.0]]))
TWO_ROOMS = Floor(
    "two_rooms",
    (0.0, 0.0, 8.0, 4.0),
    (wall(3.9, 0.0, 0.2, 1.4), wall(3.9, 2.6, 0.2, 1.4)),
    starts=np.array([[1.0, 2.0, 0.0], [1.0, 1.0, 0.0]]),
)


def settings_of(robots=1, **changes):
    return make_settings(robots=robots, resolution=0.05, stop_coverage=0.99, **changes)
