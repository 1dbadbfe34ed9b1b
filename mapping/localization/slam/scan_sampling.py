"""Points in which the beams of a scan ended, as many as what they serve needs."""

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.grids.scan_geometry import ScanGeometry
from lidarium.mapping.localization.matching.scan_points import scan_points
from lidarium.mapping.localization.matching.settings.slam import SlamSettings


class ScanSampling:
    """Samples the points of scans, in the robot's frame.

    Parameters
    ----------
    settings : SlamSettings
        How far points are taken, and how dense.
    geometry : ScanGeometry
        Directions of the beams.
    """

    def __init__(self, settings: SlamSettings, geometry: ScanGeometry) -> None:
        self._settings, self._geometry = settings, geometry
        self._unit_vectors = geometry.unit_vectors

    def points(self, ranges: NDArray[np.float32], spacing_m: float, limit: int) -> NDArray[np.float64]:
        """Return representative points in which beams ended, (n, 2) [m], thinned to few."""
        longest = min(self._settings.matching.range_m, self._geometry.range_max)
        return scan_points(
            ranges, self._unit_vectors, self._geometry.angle_increment, longest, spacing_m, limit
        )

    def all_points(self, ranges: NDArray[np.float32]) -> NDArray[np.float64]:
        """Return nearly all points in which beams ended.

        They serve what is found once per run and gains from each point, such as the direction of
        walls.
        """
        return self.points(ranges, self._settings.compass.spacing_m, self._geometry.beams)
