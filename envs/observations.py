"""What a robot observes: the spaces, and the kernel that writes observations and rewards of all rows."""

import math
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from lidarium.envs.settings import ExplorationSettings
from lidarium.envs.simulation.kinematic import KinematicWorld
from lidarium.envs.simulation.stages import RANGE_GAP
from lidarium.mapping.kernels import Array, int8_grid_at, kernel
from lidarium.mapping.occupancy import crop_levels

FARTHEST = 1000.0
"""Bound of positions in observations [m]."""


def observation_space(settings: ExplorationSettings, has_goal: bool) -> spaces.Dict:
    """Return the space of one robot's observation; every box is bounded."""
    robot, cells = settings.robot, settings.map_cells
    pose_limit = np.array([FARTHEST, FARTHEST, math.pi], np.float32)
    # The largest float32 angle that is wrapped from float64 may round up to the float32 above pi.
    pose_limit[2] = np.nextafter(np.float32(math.pi), np.float32(4.0))
    velocity_limit = np.array([robot.max_speed, robot.max_turn_rate], np.float32)
    boxes: dict[str, spaces.Space[Any]] = {
        "scan": spaces.Box(0.0, np.float32(settings.lidar.range_max), (settings.lidar.beams,), np.float32),
        "pose": spaces.Box(-pose_limit, pose_limit, dtype=np.float32),
        "velocity": spaces.Box(-velocity_limit, velocity_limit, dtype=np.float32),
        "bumper": spaces.Box(0, 1, (3,), np.int8),
        "map": spaces.Box(0, 255, (1, cells, cells), np.uint8),
    }
    if has_goal:
        boxes["goal"] = spaces.Box(-FARTHEST, FARTHEST, (2,), np.float32)
    return spaces.Dict(boxes)


def action_space() -> spaces.Box:
    """Return the space of one robot's action: speed and turn rate as shares of the robot's limits."""
    return spaces.Box(-1.0, 1.0, (2,), np.float32)


@kernel
def _write(
    ranges: Array,
    believed: Array,
    offsets: Array,
    velocities: Array,
    bumpers: Array,
    beliefs: Array,
    origins: Array,
    numbers: Array,
    scans: Array,
    poses: Array,
    motions: Array,
    presses: Array,
    maps: Array,
) -> None:
    resolution, range_max, max_speed, max_turn_rate = numbers[0], numbers[1], numbers[2], numbers[3]
    farthest, longest = np.float32(numbers[4]), np.float32(range_max - RANGE_GAP)
    no_return = np.float32(range_max)
    for row in range(ranges.shape[0]):
        for beam in range(ranges.shape[1]):
            value = ranges[row, beam]
            hit = min(value, longest)
            scans[row, beam] = no_return if value > no_return else (hit if value == value else np.float32(0.0))
        for axis in range(2):
            local = np.float32(believed[row, axis] - offsets[row, axis])
            poses[row, axis] = min(max(local, -farthest), farthest)
        poses[row, 2] = np.float32(believed[row, 2])
        motions[row, 0] = np.float32(min(max(velocities[row, 0], -max_speed), max_speed))
        motions[row, 1] = np.float32(min(max(velocities[row, 1], -max_turn_rate), max_turn_rate))
        for side in range(3):
            presses[row, side] = bumpers[row, side]
        column = int(math.floor((believed[row, 0] - origins[row, 0]) / resolution))
        map_row = int(math.floor((believed[row, 1] - origins[row, 1]) / resolution))
        log_odds = int8_grid_at(beliefs[row, 0], beliefs[row, 1], beliefs[row, 2])
        crop_levels(log_odds, map_row, column, maps[row, 0])


class ObservationWriter:
    """Writes the observations of all rows into new arrays.

    Parameters
    ----------
    settings : ExplorationSettings
        Sizes and limits.
    """

    def __init__(self, settings: ExplorationSettings) -> None:
        robot = settings.robot
        self._numbers = np.array(
            [
                settings.occupancy.resolution,
                float(np.float32(settings.lidar.range_max)),
                float(np.float32(robot.max_speed)),
                float(np.float32(robot.max_turn_rate)),
                FARTHEST,
            ]
        )
        self._cells = settings.map_cells

    def write(self, world: KinematicWorld, offsets: NDArray[np.float64]) -> dict[str, NDArray[Any]]:
        """Return new arrays with one observation a row: scan, pose, velocity, bumper, map.

        Parameters
        ----------
        world : KinematicWorld
            Where the robots are.
        offsets : (rows, 2) float64
            Origin of each robot's map frame in the frame of its believed pose [m].
        """
        rows, beams = world.ranges.shape
        arrays: dict[str, NDArray[Any]] = {
            "scan": np.empty((rows, beams), np.float32),
            "pose": np.empty((rows, 3), np.float32),
            "velocity": np.empty((rows, 2), np.float32),
            "bumper": np.empty((rows, 3), np.int8),
            "map": np.empty((rows, 1, self._cells, self._cells), np.uint8),
        }
        _write(
            world.ranges, world.believed, offsets, world.velocities, world.bumpers, world.belief_rows, world.origins, self._numbers,
            arrays["scan"], arrays["pose"], arrays["velocity"], arrays["bumper"], arrays["map"],
        )  # fmt: skip
        return arrays
