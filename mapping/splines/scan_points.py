"""The points of a scan in the frame of the robot.

Each is placed where it was seen at its own time.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.grids.scan_geometry import ScanGeometry
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.splines.curves.settings import PointSettings


@dataclass(frozen=True, slots=True, eq=False)
class ScanPoints:
    """Where the beams of a scan ended, in the frame of the robot at the last beam.

    Attributes
    ----------
    points : (n, 2) float64
        Ends of the beams that returned, in their order [m].
    beams : (n,) int64
        Their numbers.
    ranges : (n,) float64
        Their ranges [m].
    sigmas : (n,) float64
        Standard deviations of these [m].
    scan : (beams,) float64
        The whole scan [m]; inf for no return, nan for what is invalid or out of the laser's reach.
    geometry : ScanGeometry
        Directions of the beams.
    """

    points: NDArray[np.float64]
    beams: NDArray[np.int64]
    ranges: NDArray[np.float64]
    sigmas: NDArray[np.float64]
    scan: NDArray[np.float64]
    geometry: ScanGeometry


def scan_points(
    ranges: NDArray[np.float32],
    geometry: ScanGeometry,
    settings: PointSettings | None = None,
    motion: Transform | None = None,
    motion_s: float = 0.0,
) -> ScanPoints:
    """Turn a scan into points.

    Parameters
    ----------
    ranges : (beams,) float32
        The scan [m]; inf for no return, nan for an invalid beam. What is nearer than the laser's least range
        is invalid, what is farther than its greatest is no return.
    geometry : ScanGeometry
        The laser.
    settings : PointSettings or None
        Time between beams, place and noise of the laser.
    motion : Transform or None
        How the robot has moved in the time before the last beam, ``before_from_now``; None for a robot at
        rest.
    motion_s : float
        That time [s]. Speeds are taken as constant in it.

    Raises
    ------
    ValueError
        Where there are not as many ranges as beams.
    """
    settings = settings or PointSettings()
    measured = np.asarray(ranges, np.float64)
    if measured.shape != (geometry.beams,):
        raise ValueError(f"the scan has shape {measured.shape}; the laser has {geometry.beams} beams")
    scan = np.where(
        measured < geometry.range_min, np.nan, np.where(measured > geometry.range_max, np.inf, measured)
    )
    beams = np.flatnonzero(np.isfinite(scan))
    hits = scan[beams]
    cosines, sines = geometry.unit_vectors[:, beams]
    points = np.stack([hits * cosines + settings.laser_x, hits * sines], axis=1)
    if motion is not None and motion_s > 0.0 and settings.beam_interval_s > 0.0:
        shares = (geometry.beams - 1 - beams) * (settings.beam_interval_s / motion_s)
        back = motion.inverse()
        _undo_motion(points, shares, back.x, back.y, back.theta)
    sigmas = np.maximum(settings.noise_floor, settings.noise_share * hits)
    return ScanPoints(points, beams.astype(np.int64), hits, sigmas, scan, geometry)


@kernel
def _undo_motion(points: Array, shares: Array, x: float, y: float, theta: float) -> None:
    """Bring each point, seen a share of the motion ago, into the present frame.

    The frame is the robot's; ``x, y, theta`` is the former pose in it.
    """
    for k in range(points.shape[0]):
        cosine, sine = np.cos(shares[k] * theta), np.sin(shares[k] * theta)
        px, py = points[k, 0], points[k, 1]
        points[k, 0] = cosine * px - sine * py + shares[k] * x
        points[k, 1] = sine * px + cosine * py + shares[k] * y
