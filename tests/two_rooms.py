"""Two rooms with a door, for tests of explorers."""

import numpy as np

from lidarium.envs.floors.floor import Floor, Solid


def wall(x, y, width, height):
    return Solid(np.array([[x, y], [x + width, y], [x + width, y + height], [x, y + height]]))


TWO_ROOMS = Floor(
    "two_rooms",
    (0.0, 0.0, 7.0, 4.5),
    (wall(3.4, 0.0, 0.2, 1.6), wall(3.4, 2.6, 0.2, 1.9), wall(5.0, 2.0, 0.6, 0.6)),
    starts=np.array([[1.0, 1.0, 0.5], [1.0, 3.0, -0.5]]),
)
