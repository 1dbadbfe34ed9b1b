"""Floors of few rooms, for tests."""

import numpy as np

from lidarium.envs.floors.floor import Floor, Solid


def wall(x, y, width, height):
    return Solid(np.array([[x, y], [x + width, y], [x + width, y + height], [x, y + height]]))


def two_rooms(door=0.0):
    """A room of 4 m x 4 m and one of 2 m x 4 m behind a wall, with a door in it."""
    parts = (wall(4.0, 0.0, 0.1, 2.0 - door / 2.0), wall(4.0, 2.0 + door / 2.0, 0.1, 2.0 - door / 2.0))
    return Floor("rooms", (0.0, 0.0, 6.1, 4.0), parts).raster(0.025, 0.0, 1.0)
