"""Local maps: what some neighbouring scans agree on, in a frame of their own.

A cell's agreement is the mean, over the scans that observed it, of the weight with which a beam ended there:
a beam's end is shared out among the four cells around it in the way of bilinear interpolation, so that the
middle of a wall is kept to a fraction of a cell; a scan that saw through counts as nothing. What moved,
fades. This is the counting model (Haehnel et al., IROS 2003) with shares in place of whole hits.

What scans saw of a cell is whether a beam that came as far ended there. With noise that share grows towards
the back of a wall, which hardly a beam passes: it is a hazard, and no density. Where a beam ended, known
walls a little behind count as seen through, therefore; without that, they come to lie behind where they are,
and a robot that goes by them runs ahead of itself.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.grids.scan_geometry import ScanGeometry
from lidarium.mapping.localization.matching.settings.matching import SubmapSettings
from lidarium.mapping.localization.matching.submap_updates import Cells, insert_scan

UNSEEN, FREE_LEVEL, FULL_LEVEL = 0, 1, 255
"""Levels of agreement: unobserved, free, and full.

Full means that a beam ended in the middle of the cell each time.
"""


_MARGIN = 4


class AgreementGrid(NamedTuple):
    """A local map's agreement.

    Attributes
    ----------
    levels : (rows, columns) uint8
        ``UNSEEN``, or from ``FREE_LEVEL`` to ``FULL_LEVEL`` in proportion to the agreement. Row 0 at the
        lowest y.
    column, row : int
        Place of the first cell, in cells from the frame's origin.
    resolution : float
        Side of a cell [m].
    """

    levels: NDArray[np.uint8]
    column: int
    row: int
    resolution: float


class Submap:
    """A local map that grows by scans until it is finished.

    Parameters
    ----------
    settings : SubmapSettings
        How.
    reach_m : float
        How far from its origin what it holds may lie at most [m].

    Attributes
    ----------
    scans : int
        How many it holds.
    """

    def __init__(self, settings: SubmapSettings, reach_m: float) -> None:
        resolution = settings.resolution
        half = math.ceil(reach_m / resolution) + _MARGIN
        # A multiple of 64, so that words of bits begin where cells do; memory is provided where it is touched
        # only.
        self._half = -(-half // 64) * 64
        side = 2 * self._half
        self._cells = Cells(
            np.zeros((side, side), np.float32),
            np.zeros((side, side), np.float32),
            np.zeros((side, side), np.uint16),
            np.zeros((side, side), np.uint8),
            np.array([side, 0, side, 0], np.int64),
        )
        self._resolution = resolution
        self._behind = (settings.behind_m / resolution, settings.behind_share)
        self.scans = 0

    @property
    def grid(self) -> AgreementGrid:
        """Return the agreement, a view that changes with the next scan."""
        return AgreementGrid(self._cells.levels, -self._half, -self._half, self._resolution)

    def insert(
        self, pose: NDArray[np.float64], ranges: NDArray[np.float32], geometry: ScanGeometry, longest: float
    ) -> bool:
        """Take in a scan.

        Parameters
        ----------
        pose : (3,) float64
            x, y, theta of the laser in the local map's frame [m, rad].
        ranges : (beams,) float32
            The scan [m]; inf for no return, nan for an invalid beam.
        geometry : ScanGeometry
            Directions of the beams.
        longest : float
            Longest range that counts [m]; a return beyond it says that the way there is free.

        Returns
        -------
        bool
            False where the scan does not fit in: nothing is changed then.
        """
        scale = 1.0 / self._resolution
        reach = min(longest, geometry.range_max) * scale
        x, y = pose[0] * scale + self._half, pose[1] * scale + self._half
        side = 2 * self._half
        if not (reach + _MARGIN <= min(x, y) and max(x, y) <= side - reach - _MARGIN):
            return False
        numbers = (geometry.angle_increment, reach, scale, float(geometry.is_full_circle), *self._behind)
        insert_scan(self._cells, (x, y, float(pose[2])), ranges, numbers, geometry.unit_vectors)
        self.scans += 1
        return True

    def finished(self) -> AgreementGrid:
        """Return the agreement for good, cropped to what was observed."""
        low_row, high_row, low_column, high_column = (int(value) for value in self._cells.box)
        if low_row >= high_row:
            return AgreementGrid(np.zeros((1, 1), np.uint8), 0, 0, self._resolution)
        levels = self._cells.levels[low_row:high_row, low_column:high_column].copy()
        return AgreementGrid(levels, low_column - self._half, low_row - self._half, self._resolution)
