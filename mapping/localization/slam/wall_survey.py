"""Where walls run along a path: surveyed in a local map, then compared with each scan."""

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.rigid import Transform, relative
from lidarium.mapping.localization.matching.settings.slam import SlamSettings
from lidarium.mapping.localization.matching.wall_compass import WallCompass
from lidarium.mapping.localization.slam.scan_history import ScanHistory
from lidarium.mapping.localization.slam.scan_sampling import ScanSampling


class WallSurvey:
    """Surveys where walls run, and compares later scans with them.

    Parameters
    ----------
    settings : SlamSettings
        Whether walls are used, and after how much of a path they are surveyed.
    sampling : ScanSampling
        Samples the points of scans.

    Attributes
    ----------
    compass : WallCompass or None
        Directions of walls; None where they are not used.
    """

    def __init__(self, settings: SlamSettings, sampling: ScanSampling) -> None:
        self.compass = WallCompass(settings.compass) if settings.uses_walls else None
        self._sampling, self._after_m = sampling, settings.graph.start_path_m
        self._due_m = self._after_m

    def restart(self, length_m: float) -> None:
        """Survey again after as much of the path: other local maps begin at this length [m]."""
        if self.compass is not None:
            self.compass.forget()
            self._due_m = length_m + self._after_m

    def observe(self, ranges: NDArray[np.float32], pose: NDArray[np.float64]) -> None:
        """Compare the walls of a scan at a pose (3,) in the frame of the last node [m, rad]."""
        if self.compass is not None and self.compass.is_surveyed:
            self.compass.observe(Transform(*pose).apply(self._sampling.all_points(ranges)))

    def survey(self, length_m: float, node: int, history: ScanHistory, nodes: NDArray[np.float64]) -> None:
        """Survey where walls run in the local map of a node, if it is time to.

        Where none do, survey again after as much of the path.
        """
        if self.compass is None or self.compass.is_surveyed or length_m < self._due_m:
            return
        self._due_m = length_m + self._after_m
        scans, since = history.scans(nodes), history.since(node)
        poses = relative(nodes[node], scans.poses[since])
        points = [
            Transform(*pose).apply(self._sampling.all_points(ranges))
            for pose, ranges in zip(poses, scans.ranges[since], strict=True)
        ]
        if points:  # none of the scans since may have been kept
            self.compass.survey(np.concatenate(points), node, float(nodes[node, 2]))
