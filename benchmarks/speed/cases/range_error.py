"""Error of our ranges against exact casting.

The reference knows nothing of traversal: for each beam it is the nearest of the entry points into all solid
cells beside free ones that lie in reach, each by intersecting the beam with the cell's square.
"""

import math

import numba
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from lidarium.benchmarks.speed.cases.ray_casting import all_floors
from lidarium.benchmarks.speed.harness.lines import Line
from lidarium.benchmarks.speed.harness.report import run_alone
from lidarium.benchmarks.speed.harness.timing import Effort
from lidarium.benchmarks.speed.scenes.floors import BenchFloor, free_poses
from lidarium.benchmarks.speed.scenes.teams import BEAMS, LIDAR, RANGE_MAX
from lidarium.envs.simulation.kernels.ray_casting import cast_scans
from lidarium.mapping.kernels.compilation import Array

POSES = 12
ALLOWED_MM = 0.1

CORES = 1

NOTES = (
    "*Range error*: the greatest difference between the ranges (float32) and the nearest entry point into any solid "
    "cell, over 12 poses of 720 beams on each of the four floors.",
)


@numba.njit
def _exact(x: float, y: float, cosine: float, sine: float, cells: Array, reach: float) -> float:
    """Return the distance along a beam to the nearest of the cells, in cells.

    The cells are (N, 2: column, row); all lengths are in cells.
    """
    nearest = reach
    for k in range(cells.shape[0]):
        enter_x, leave_x = -math.inf, math.inf
        if cosine != 0.0:
            first, second = (cells[k, 0] - x) / cosine, (cells[k, 0] + 1.0 - x) / cosine
            enter_x, leave_x = min(first, second), max(first, second)
        elif x < cells[k, 0] or x > cells[k, 0] + 1.0:
            continue
        enter_y, leave_y = -math.inf, math.inf
        if sine != 0.0:
            first, second = (cells[k, 1] - y) / sine, (cells[k, 1] + 1.0 - y) / sine
            enter_y, leave_y = min(first, second), max(first, second)
        elif y < cells[k, 1] or y > cells[k, 1] + 1.0:
            continue
        enter = max(enter_x, enter_y)
        if 0.0 <= enter <= min(leave_x, leave_y) and enter < nearest:
            nearest = enter
    return nearest


@numba.njit
def _exact_scan(pose: Array, angles: Array, cells: Array, reach: float) -> Array:
    ranges = np.empty(angles.shape[0])
    for beam in range(angles.shape[0]):
        angle = pose[2] + angles[beam]
        ranges[beam] = _exact(pose[0], pose[1], math.cos(angle), math.sin(angle), cells, reach)
    return ranges


def exact_ranges(floor: BenchFloor, poses: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the reference ranges at poses (N, 3) [m, rad], shape (N, beams) [m].

    A range is ``RANGE_MAX`` for no return.
    """
    solid = floor.solid != 0
    surface = solid & ndimage.binary_dilation(~solid, np.ones((3, 3), np.bool_))
    rows, columns = np.nonzero(surface)
    cells = np.column_stack([columns, rows]).astype(np.float64)
    reach = RANGE_MAX / floor.resolution
    scans = []
    for pose in poses / [floor.resolution, floor.resolution, 1.0]:
        in_reach = np.hypot(*(cells + 0.5 - pose[:2]).T) < reach + 1.0
        scans.append(_exact_scan(pose, LIDAR.angles, cells[in_reach], reach))
    return np.array(scans) * floor.resolution


def our_ranges(floor: BenchFloor, poses: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the ranges at poses (N, 3) [m, rad] by the package, shape (N, beams) [m]."""
    tables = floor.tables()
    ranges = np.empty((len(poses), BEAMS))
    scaled = poses / [floor.resolution, floor.resolution, 1.0]
    reach = RANGE_MAX / floor.resolution
    cast_scans(
        tables.rays.addresses, scaled, LIDAR.unit_vectors, LIDAR.angle_first, LIDAR.angle_increment, reach, ranges
    )
    return (ranges * floor.resolution).astype(np.float32).astype(np.float64)


def measure(effort: Effort) -> list[Line]:
    """Compare our ranges with the reference."""
    lines = []
    for name, floor in all_floors().items():
        poses = free_poses(floor, POSES, seed=2)
        exact = exact_ranges(floor, poses)
        error = 1000.0 * float(np.abs(our_ranges(floor, poses) - exact).max())
        lines.append(
            Line(
                f"greatest error of a range, {name}",
                f"{error:.2g} mm",
                "-",
                None,
                ALLOWED_MM,
                error,
                is_upper_bound=True,
                unit="mm",
            )
        )
    return lines


if __name__ == "__main__":
    run_alone(measure, "Error of our ranges against exact casting.")
