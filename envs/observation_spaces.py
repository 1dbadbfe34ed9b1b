"""Spaces of observations, with the actions beside them."""

import math

import numpy as np
from gymnasium import spaces

from lidarium.envs.settings.exploration import OBSERVABLES, ExplorationSettings
from lidarium.envs.settings.sensors.observables import SENSED

FARTHEST = 1000.0
"""Bound of positions in observations [m]."""


KEYS = (*OBSERVABLES, "goal")
"""All that the kernel writes, in the order in which it takes the arrays."""


def observed_keys(settings: ExplorationSettings, has_goal: bool) -> tuple[str, ...]:
    """Return the keys of an observation.

    They are what the settings choose, and the goal where there is one.
    """
    return (*settings.observe, "goal") if has_goal else settings.observe


def observation_space(settings: ExplorationSettings, has_goal: bool) -> spaces.Dict:
    """Return the space of one robot's observation; every box is bounded."""
    boxes = boxes_of(settings)
    return spaces.Dict({name: boxes[name] for name in observed_keys(settings, has_goal)})


def boxes_of(settings: ExplorationSettings) -> dict[str, spaces.Box]:
    """Return the space of everything that can be observed."""
    robot, cells, own_cells = settings.robot, settings.map_cells, settings.egocentric_cells
    pose_limit = np.array([FARTHEST, FARTHEST, math.pi], np.float32)
    # The largest float32 angle that is wrapped from float64 may round up to the float32 above pi.
    pose_limit[2] = np.nextafter(np.float32(math.pi), np.float32(4.0))
    velocity_limit = np.array([robot.max_speed, robot.max_turn_rate], np.float32)
    return {
        "scan": spaces.Box(0.0, np.float32(settings.lidar.range_max), (settings.lidar.beams,), np.float32),
        "pose": spaces.Box(-pose_limit, pose_limit, dtype=np.float32),
        "velocity": spaces.Box(-velocity_limit, velocity_limit, dtype=np.float32),
        "bumper": spaces.Box(0, 1, (3,), np.int8),
        "map": spaces.Box(0, 255, (1, cells, cells), np.uint8),
        "egocentric_map": spaces.Box(
            0, 255, (len(settings.egocentric_scales), own_cells, own_cells), np.uint8
        ),
        "goal": spaces.Box(-FARTHEST, FARTHEST, (2,), np.float32),
        **{name: SENSED[name].box(settings) for name in settings.observe if name in SENSED},
    }


def action_space() -> spaces.Box:
    """Return the space of one robot's action.

    An action is speed and turn rate as shares of the robot's limits.
    """
    return spaces.Box(-1.0, 1.0, (2,), np.float32)
