"""Updates of maps by scans, besides other mappers."""

import itertools
import math

import cv2
import numba
import numpy as np
from numpy.typing import NDArray

from lidarium.benchmarks.speed.harness.lines import Line, faster
from lidarium.benchmarks.speed.harness.report import run_alone
from lidarium.benchmarks.speed.harness.timing import Effort, interleaved, repeated
from lidarium.benchmarks.speed.scenes.floors import straight_floor
from lidarium.benchmarks.speed.scenes.teams import RANGE_MAX, DrivenTeam
from lidarium.mapping.grids.occupancy import OccupancyGrid, OccupancySettings
from lidarium.mapping.kernels.compilation import Array


class PolygonUpdate:
    """A map update that fills the polygon of the beams' ends.

    It uses ``cv2.fillPoly`` and changes the map with numpy, in the scan's window.

    `shape` (rows, columns): size of the map [cells]; `increments` (4,) int64: hit, miss, least and greatest value.
    """

    def __init__(self, shape: tuple[int, int], increments: NDArray[np.int64]) -> None:
        self.log_odds = np.zeros(shape, np.int8)
        self._hit, self._miss, self._least, self._greatest = (int(value) for value in increments)

    def update(
        self,
        x: float,
        y: float,
        directions: NDArray[np.float64],
        lengths: NDArray[np.float64],
        is_hit: NDArray[np.bool_],
    ) -> None:
        """Put in a scan from x, y with beams of these directions and lengths.

        Directions are (2, beams), lengths in cells.
        """
        rows, columns = self.log_odds.shape
        ends = np.floor(np.stack([x, y]) + (directions * lengths).T).astype(np.int32)
        np.clip(ends, 0, (columns - 1, rows - 1), out=ends)
        low, high = (np.minimum(ends.min(axis=0), (int(x), int(y))), np.maximum(ends.max(axis=0), (int(x), int(y))) + 1)
        outline = np.concatenate([[(int(x), int(y))], ends]).astype(np.int32) - low.astype(np.int32)
        seen = np.zeros((high[1] - low[1], high[0] - low[0]), np.uint8)
        cv2.fillPoly(seen, [outline], self._miss)
        hits = ends[is_hit] - low
        seen[hits[:, 1], hits[:, 0]] = 0
        window = self.log_odds[low[1] : high[1], low[0] : high[0]]
        raised = np.minimum(window[hits[:, 1], hits[:, 0]] + self._hit, self._greatest)
        # The cells stay within +-127 units: no sum leaves int8 before it is bounded.
        np.subtract(window, seen.view(np.int8), out=window)
        np.maximum(window, self._least, out=window)
        window[hits[:, 1], hits[:, 0]] = raised


@numba.njit
def update_by_rays(
    log_odds: Array, x: float, y: float, directions: Array, lengths: Array, is_hit: Array, increments: Array
) -> None:
    """Put in a scan by walking along every beam. Each cell on the beam is lowered, the last one is raised."""
    hit, miss, least, greatest = increments[0], increments[1], increments[2], increments[3]
    rows, columns = log_odds.shape
    for beam in range(lengths.shape[0]):
        cosine, sine, length = directions[0, beam], directions[1, beam], lengths[beam]
        column, row = math.floor(x), math.floor(y)
        last_column, last_row = math.floor(x + length * cosine), math.floor(y + length * sine)
        step_column, step_row = (1 if cosine >= 0.0 else -1), (1 if sine >= 0.0 else -1)
        per_column = abs(1.0 / cosine) if cosine != 0.0 else math.inf
        per_row = abs(1.0 / sine) if sine != 0.0 else math.inf
        to_column = ((column + 1 - x) if cosine >= 0.0 else (x - column)) * per_column if cosine != 0.0 else math.inf
        to_row = ((row + 1 - y) if sine >= 0.0 else (y - row)) * per_row if sine != 0.0 else math.inf
        for _ in range(abs(last_column - column) + abs(last_row - row)):
            if 0 <= row < rows and 0 <= column < columns:
                log_odds[row, column] = max(log_odds[row, column] - miss, least)
            if to_column < to_row:
                column += step_column
                to_column += per_column
            else:
                row += step_row
                to_row += per_row
        if is_hit[beam] and 0 <= row < rows and 0 <= column < columns:
            log_odds[row, column] = min(log_odds[row, column] + hit, greatest)


ROBOTS = 16

CORES = 1

NOTES = (
    "*Map update*: the same 16 noisy scans of 720 beams into int8 log-odds of 2.5 cm cells, by one call of "
    "`KinematicWorld.perceive` for 16 maps, or *called scan by scan* (`OccupancyGrid.integrate`). *fillPoly and "
    "numpy* and *ray traversal* (numba) update one map scan by scan.",
)


def measure(effort: Effort) -> list[Line]:
    """Compare the ways to update a map."""
    team = DrivenTeam(straight_floor(), ROBOTS)
    for _ in range(30):
        team.step()
    simulation, floor = team.simulation, straight_floor()
    lidar, settings = simulation.lidars[0], OccupancySettings(resolution=floor.resolution)
    scans: list[tuple[float, float, NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]] = []
    for pose, ranges in zip(simulation.world.poses, simulation.ranges.astype(np.float64), strict=True):
        cosine, sine = np.cos(pose[2]), np.sin(pose[2])
        directions = np.array([[cosine, -sine], [sine, cosine]]) @ lidar.unit_vectors
        lengths = np.minimum(ranges, RANGE_MAX) / floor.resolution
        scans.append((pose[0] / floor.resolution, pose[1] / floor.resolution, directions, lengths, np.isfinite(ranges)))
    for_polygons, for_rays = itertools.cycle(scans), itertools.cycle(scans)
    for_grid = itertools.cycle(list(zip(simulation.world.poses.copy(), simulation.ranges.copy(), strict=True)))
    polygons = PolygonUpdate(floor.solid.shape, settings.increments)
    log_odds = np.zeros(floor.solid.shape, np.int8)
    grid = OccupancyGrid(
        settings, (0.0, 0.0, floor.solid.shape[1] * floor.resolution, floor.solid.shape[0] * floor.resolution)
    )
    update_by_rays(log_odds, *next(for_rays), settings.increments)
    simulation.perceive()
    seconds = interleaved(
        {
            "ours": repeated(simulation.perceive, ROBOTS),
            "one by one": repeated(lambda: grid.integrate(*next(for_grid), lidar)),
            "polygons": repeated(lambda: polygons.update(*next(for_polygons))),
            "rays": repeated(lambda: update_by_rays(log_odds, *next(for_rays), settings.increments)),
        },
        effort,
    )
    return [
        faster(
            "map update of a noisy scan", seconds["ours"], "fillPoly and numpy", seconds["polygons"], 5.0, "scans/s"
        ),
        faster("map update of a noisy scan", seconds["ours"], "ray traversal", seconds["rays"], 7.0, "scans/s"),
        faster(
            "map update, called scan by scan",
            seconds["one by one"],
            "fillPoly and numpy",
            seconds["polygons"],
            None,
            "scans/s",
        ),
    ]


if __name__ == "__main__":
    run_alone(measure, "Map update of a noisy scan beside two usual ways.")
