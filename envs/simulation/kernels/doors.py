"""Doors in kernels: sliding leaves that open when somebody comes."""

import math

from lidarium.envs.simulation.kernels.arrays import (
    DOOR_END_X,
    DOOR_END_Y,
    DOOR_HOLD,
    DOOR_KIND,
    DOOR_OPEN,
    DOOR_X,
    DOOR_Y,
    OPENS,
    TIME_STEP,
    WALKER_X,
    WALKER_Y,
    WorldArrays,
    doors_of,
    walkers_of,
)
from lidarium.mapping.kernels.compilation import Array, kernel

SENSOR_M = 1.4
"""Doors open if somebody is this near to their middle [m]."""

OPENING_S, HOLD_S = 1.0, 3.0
"""Time in which a leaf slides from end to end, and for which it stays open after the last that came [s]."""


@kernel(nrt=False)
def _somebody_is_near(world: WorldArrays, episode: int, robots: int, x: float, y: float) -> bool:
    """Whether a person, or a robot that has not ended, is near the middle of a door."""
    walkers = walkers_of(world, episode)
    for person in range(walkers.shape[0]):
        if math.hypot(walkers[person, WALKER_X] - x, walkers[person, WALKER_Y] - y) < SENSOR_M:
            return True
    for row in range(episode * robots, (episode + 1) * robots):
        if math.hypot(world.poses[row, 0] - x, world.poses[row, 1] - y) < SENSOR_M:
            return True
    return False


@kernel(nrt=False)
def move_doors(world: WorldArrays, episode: int, robots: int) -> None:
    """Slide the leaves of an episode's doors for one step."""
    doors: Array = doors_of(world, episode)
    step_s = world.sensor[0, TIME_STEP]
    for door in range(doors.shape[0]):
        if doors[door, DOOR_KIND] != OPENS:
            continue
        x = 0.5 * (doors[door, DOOR_X] + doors[door, DOOR_END_X])
        y = 0.5 * (doors[door, DOOR_Y] + doors[door, DOOR_END_Y])
        slide = step_s / OPENING_S
        if _somebody_is_near(world, episode, robots, x, y):
            doors[door, DOOR_HOLD] = math.ceil(HOLD_S / step_s)
            doors[door, DOOR_OPEN] = min(doors[door, DOOR_OPEN] + slide, 1.0)
        elif doors[door, DOOR_HOLD] > 0.0:
            doors[door, DOOR_HOLD] -= 1.0
        else:
            doors[door, DOOR_OPEN] = max(doors[door, DOOR_OPEN] - slide, 0.0)
