"""How well a localizer on a spline map did: its poses, its map, and its size."""

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.floors.floor import Floor
from lidarium.evaluation.metrics.curves import (
    curve_precision,
    end_point_bytes,
    grid_bytes,
    hits_of_beams,
    seen_walls,
    wall_error,
    wall_recall,
)
from lidarium.evaluation.metrics.poses import absolute_error, moved
from lidarium.mapping.files.spline_files import compact_bytes
from lidarium.mapping.geometry.rigid import relative
from lidarium.mapping.grids.scan_geometry import ScanGeometry
from lidarium.mapping.localization.localizer import Sensing
from lidarium.mapping.localization.on_splines.spline_filter import SplineFilterSettings
from lidarium.mapping.localization.on_splines.spline_matches import TrackingSettings
from lidarium.mapping.localization.on_splines.spline_tracking import SplineTracker
from lidarium.mapping.splines.settings import spline_settings
from lidarium.mapping.splines.spline_map import SplineMap

THESIS = SplineFilterSettings(tracking=TrackingSettings(splines=spline_settings("thesis")))
"""The particle filter on a map that is made by the thesis's rules."""

SPACING = 0.01
"""Distance of the points along curves and walls that are compared [m]."""

Poses = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class MapFigures:
    """Figures of a run: lengths in metres, angles in degrees, shares, bytes.

    `ate_m`, `end_m`, `end_deg`: error of the poses: root of the mean square over the path, and at its end;
    `odometry_ate_m`: the same of odometry alone; `wall_mean_m`, `wall_p95_m`: how far curves lie from walls; `recall`,
    `precision`: share of the walls within 5 cm of a curve, of those where true beams end; share of the curves within 5
    cm of a wall; `curves`, `control_points`, `size_bytes`: size of the map, the last in its compact form;
    `of_end_points`, `of_grid`: its bytes as a share of those of the end points of the scans that went into it, and of a
    5 cm grid.
    """

    ate_m: float
    end_m: float
    end_deg: float
    odometry_ate_m: float
    wall_mean_m: float
    wall_p95_m: float
    recall: float
    precision: float
    curves: int
    control_points: int
    size_bytes: int
    of_end_points: float
    of_grid: float


class Followed(NamedTuple):
    """What a localizer believed on a path (times, 3), the end points in its map, and the CPU time of each step [s]."""

    believed: Poses
    returns: int
    seconds: list[float]


def follow(
    localizer: SplineTracker, scans: Sequence[NDArray[np.float32]], odometry: Poses, time_step: float
) -> Followed:
    """Let a localizer follow a path by what was sensed on it."""
    believed, seconds, returns = [], [], 0
    for k, (ranges, reckoned) in enumerate(zip(scans, odometry, strict=True)):
        updates, began = localizer.updates, time.process_time()
        believed.append(localizer.localize(Sensing(k * time_step, reckoned, ranges)))
        seconds.append(time.process_time() - began)
        if localizer.updates > updates:
            returns += int((ranges < localizer.geometry.range_max).sum())
    return Followed(np.array(believed), returns, seconds)


def map_figures(
    floor: Floor,
    spline_map: SplineMap,
    geometry: ScanGeometry,
    true: Poses,
    believed: Poses,
    odometry: Poses,
    returns: int,
) -> MapFigures:
    """Compare what a localizer believed with the truth.

    `true`, `believed`, `odometry` (times, 3) float64: poses x, y, theta [m, rad]; odometry in a frame of its own.
    """
    curves = spline_map.sample(SPACING)
    edges = np.concatenate([solid.edges for solid in floor.solids])
    walls, size = wall_error(curves, edges), compact_bytes(spline_map)
    turn = float(believed[-1, 2] - true[-1, 2])
    alone = moved(_from_first(odometry), true[0])
    hits = hits_of_beams(edges, true, geometry.angles, geometry.range_max)
    return MapFigures(
        ate_m=absolute_error(believed, true, is_aligned=False),
        end_m=math.dist(believed[-1, :2], true[-1, :2]),
        end_deg=math.degrees(abs(math.remainder(turn, math.tau))),
        odometry_ate_m=absolute_error(alone, true, is_aligned=False),
        wall_mean_m=walls.mean,
        wall_p95_m=walls.p95,
        recall=wall_recall(seen_walls(edges, hits), curves),
        precision=curve_precision(curves, edges),
        curves=len(spline_map.curves),
        control_points=sum(len(curve.spline.control_points) for curve in spline_map.curves),
        size_bytes=size,
        of_end_points=size / end_point_bytes(max(returns, 1)),
        of_grid=size / grid_bytes(floor.bounds),
    )


def _from_first(poses: Poses) -> Poses:
    """Return poses in the frame of the first one."""
    return np.asarray(relative(np.repeat(poses[:1], len(poses), axis=0), poses))
