"""Map update of a noisy scan, beside two alternatives.

They are cv2.fillPoly with numpy, and walking along the beams.
"""

import itertools

import numpy as np
from numpy.typing import NDArray

from lidarium.benchmarks.speed.harness.lines import Line, faster
from lidarium.benchmarks.speed.harness.report import run_alone
from lidarium.benchmarks.speed.harness.timing import Effort, interleaved, repeated
from lidarium.benchmarks.speed.peers.map_updates import PolygonUpdate, update_by_rays
from lidarium.benchmarks.speed.scenes.floors import straight_floor
from lidarium.benchmarks.speed.scenes.teams import RANGE_MAX, DrivenTeam
from lidarium.mapping.grids.occupancy import OccupancyGrid, OccupancySettings

ROBOTS = 16

CORES = 1

NOTES = (
    "*Map update*: the same 16 noisy scans of 720 beams into int8 log-odds of 2.5 cm cells on the straight "
    "floor. Ours is "
    "`KinematicWorld.perceive`, one call for 16 maps, hits on teammates taken out; the line *called scan by "
    "scan* is "
    "`OccupancyGrid.integrate`, which checks its arguments each time. *fillPoly and numpy* and *ray "
    "traversal* (numba) update one map "
    "scan by scan.",
)


def measure(effort: Effort) -> list[Line]:
    """Compare the ways to update a map."""
    team = DrivenTeam(straight_floor(), ROBOTS)
    for _ in range(30):
        team.step()
    simulation, floor = team.simulation, straight_floor()
    lidar, settings = simulation.lidar, OccupancySettings(resolution=floor.resolution)
    scans: list[tuple[float, float, NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]] = []
    for pose, ranges in zip(simulation.world.poses, simulation.ranges.astype(np.float64), strict=True):
        cosine, sine = np.cos(pose[2]), np.sin(pose[2])
        directions = np.array([[cosine, -sine], [sine, cosine]]) @ lidar.unit_vectors
        lengths = np.minimum(ranges, RANGE_MAX) / floor.resolution
        scans.append(
            (pose[0] / floor.resolution, pose[1] / floor.resolution, directions, lengths, np.isfinite(ranges))
        )
    for_polygons, for_rays = itertools.cycle(scans), itertools.cycle(scans)
    for_grid = itertools.cycle(
        list(zip(simulation.world.poses.copy(), simulation.ranges.copy(), strict=True))
    )
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
            "map update of a noisy scan",
            seconds["ours"],
            "fillPoly and numpy",
            seconds["polygons"],
            5.0,
            "scans/s",
        ),
        faster(
            "map update of a noisy scan", seconds["ours"], "ray traversal", seconds["rays"], 7.0, "scans/s"
        ),
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
