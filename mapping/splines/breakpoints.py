"""Which neighbouring points of a scan lie on one surface."""

import math

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.splines.curves.settings import BREAKPOINT_TESTS, SegmentationSettings
from lidarium.mapping.splines.scan_points import ScanPoints


def clusters(points: ScanPoints, settings: SegmentationSettings | None = None) -> NDArray[np.int64]:
    """Cut the points of a scan where the surface ends.

    A beam without a return, or an invalid one, always breaks. Dietmayer's test is printed with a difference
    of the ranges where their smaller one is meant, and with its sense turned round; it is used as meant.

    Parameters
    ----------
    points : ScanPoints
        The scan.
    settings : SegmentationSettings or None
        Which test; clusters with too few points are left out.

    Returns
    -------
    (k, 2) int64
        First point of each cluster and the one after its last.
    """
    settings = settings or SegmentationSettings()
    count = len(points.points)
    if count == 0:
        return np.empty((0, 2), np.int64)
    is_break = np.zeros(count, np.bool_)
    numbers = np.array(
        [
            points.geometry.angle_increment,
            settings.incidence,
            settings.noise_sigmas,
            settings.dietmayer_floor,
            settings.dietmayer_share,
            settings.step_ratio,
            settings.most_turn,
        ]
    )
    test = BREAKPOINT_TESTS.index(settings.test)
    _find_breaks(points.points, points.beams, points.ranges, points.sigmas, numbers, test, is_break)
    edges = np.flatnonzero(np.append(is_break, True))
    found = np.stack([np.append(0, edges[:-1]), edges], axis=1)
    return np.asarray(found[found[:, 1] - found[:, 0] >= settings.least_points], np.int64)


@kernel
def _find_breaks(
    points: Array, beams: Array, ranges: Array, sigmas: Array, numbers: Array, test: int, is_break: Array
) -> None:
    """Mark each point that does not belong to the one before it.

    ``test`` is an index into ``BREAKPOINT_TESTS``.
    """
    increment, incidence, noise_sigmas, floor, share, step_ratio, most_turn = numbers
    count = points.shape[0]
    grazing = math.sin(increment) / math.sin(max(incidence - increment, 1e-3))
    direct = 2.0 * math.sin(increment / 2.0)
    for k in range(1, count):
        if beams[k] != beams[k - 1] + 1:
            is_break[k] = True
            continue
        x, y = points[k, 0] - points[k - 1, 0], points[k, 1] - points[k - 1, 1]
        distance = math.sqrt(x * x + y * y)
        nearer = min(ranges[k], ranges[k - 1])
        if test == 0:
            is_break[k] = distance > nearer * grazing + noise_sigmas * max(sigmas[k], sigmas[k - 1])
        elif test == 1:
            is_break[k] = distance > nearer * direct + max(floor, share * max(ranges[k], ranges[k - 1]))
    if test != 2:
        return
    for k in range(1, count - 1):
        if is_break[k] or beams[k + 1] != beams[k] + 1:
            continue
        ax, ay = points[k, 0] - points[k - 1, 0], points[k, 1] - points[k - 1, 1]
        bx, by = points[k + 1, 0] - points[k, 0], points[k + 1, 1] - points[k, 1]
        before, after = math.sqrt(ax * ax + ay * ay), math.sqrt(bx * bx + by * by)
        # Steps and turns that noise alone can make show nothing.
        noise = noise_sigmas * sigmas[k]
        if max(before, after) > step_ratio * max(min(before, after), noise):
            is_break[k if before > after else k + 1] = True
        elif min(before, after) > noise and abs(math.atan2(ax * by - ay * bx, ax * bx + ay * by)) > most_turn:
            is_break[k + 1] = True
