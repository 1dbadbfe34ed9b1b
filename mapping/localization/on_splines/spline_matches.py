"""Matches of a scan's points, lines and rays with a map of curves.

They are arrays that filters weigh.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.splines.curve_lookup import CurveLookup
from lidarium.mapping.splines.curves.settings import AssociationSettings
from lidarium.mapping.splines.features import Observation, match_points
from lidarium.mapping.splines.landmarks import Landmarks
from lidarium.mapping.splines.spline_map import SplineMap


@dataclass(frozen=True, slots=True, eq=False)
class Matches:
    """What is seen in the robot's frame, and what of the map it is.

    Attributes
    ----------
    points, known_points : (n, 2) float64
        Corners and peaks [m].
    point_sigmas : (n,) float64
        Standard deviations of their ranges [m].
    lines, known_lines : (m, 3) float64
        A point x, y of the line, and its direction [m, rad].
    line_sigmas : (m,) float64
        Standard deviations of their ranges [m].
    rays : (k, 2) float64
        Ends of some beams that lie near curves of the map [m].
    pieces : (k, 5) float64
        The straight piece of a curve that is nearest to each: middle x, y, unit vector along, half length
        [m].
    """

    points: NDArray[np.float64]
    known_points: NDArray[np.float64]
    point_sigmas: NDArray[np.float64]
    lines: NDArray[np.float64]
    known_lines: NDArray[np.float64]
    line_sigmas: NDArray[np.float64]
    rays: NDArray[np.float64]
    pieces: NDArray[np.float64]

    @property
    def features(self) -> int:
        """How many features are matched."""
        return len(self.points) + len(self.lines)


def match(
    observation: Observation,
    spline_map: SplineMap,
    lookup: CurveLookup,
    pose: Transform,
    stride: int,
    least_sightings: int,
) -> Matches:
    """Match a scan to the map from about where it was taken.

    Parameters
    ----------
    observation : Observation
        The scan, in the frame of the robot.
    spline_map : SplineMap
        The map.
    lookup : CurveLookup
        Its curves around the pose.
    pose : Transform
        Where the robot about is, ``map_from_robot``.
    stride : int
        Every so many-th beam that returned is a ray.
    least_sightings : int
        Points of the map that fewer scans have seen are left out.
    """
    settings = spline_map.settings.association
    features, seen = observation.features, observation.features.moved(pose)
    matched = [
        _matched_points(own, placed, known, settings.point_distance, least_sightings)
        for own, placed, known in (
            (features.corners, seen.corners, spline_map.corners),
            (features.peaks, seen.peaks, spline_map.peaks),
        )
    ]
    sigmas = (features.corner_sigmas, features.peak_sigmas)
    which_lines, references, known_lines = _matched_lines(seen.lines, spline_map.lines, pose, settings)
    rays = observation.points.points[::stride]
    pieces, _ = lookup.look_up(pose.apply(rays))
    is_known = pieces >= 0
    own_references = pose.inverse().apply(references)
    return Matches(
        np.concatenate([part[0] for part in matched]),
        np.concatenate([part[1] for part in matched]),
        np.concatenate([sigma[part[2]] for sigma, part in zip(sigmas, matched, strict=True)]),
        np.column_stack([own_references, features.lines[which_lines, 2]]),
        known_lines,
        features.line_sigmas[which_lines],
        rays[is_known],
        lookup.pieces[pieces[is_known]],
    )


def _matched_points(
    own: NDArray[np.float64],
    placed: NDArray[np.float64],
    known: Landmarks,
    most_distance: float,
    least_sightings: int,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """Return seen points, their matched map points, and the indices of the seen.

    The seen points are in the robot's frame.
    """
    trusted = known.points[known.counts >= least_sightings]
    which, of_map = match_points(placed, trusted, most_distance)
    return own[which], trusted[of_map], which


def _matched_lines(
    seen: NDArray[np.float64], known: NDArray[np.float64], pose: Transform, settings: AssociationSettings
) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
    """Return indices of matched lines, reference points, and the map's lines.

    Seen lines are (n, 4). The matched are compared about points (m, 2); the map's lines are (m, 3).
    """
    if len(seen) == 0 or len(known) == 0:
        return np.empty(0, np.int64), np.empty((0, 2)), np.empty((0, 3))
    if settings.line_origin == "segment":
        references = seen[:, :2]
    else:
        along = np.stack([np.cos(seen[:, 2]), np.sin(seen[:, 2])], axis=1)
        offsets = np.array([pose.x, pose.y]) - seen[:, :2]
        references = seen[:, :2] + (offsets * along).sum(axis=1)[:, None] * along
    cosines, sines = np.cos(known[:, 2]), np.sin(known[:, 2])
    to_middle = seen[:, None, :2] - known[None, :, :2]
    to_reference = references[:, None] - known[None, :, :2]
    along_known = to_middle[..., 0] * cosines + to_middle[..., 1] * sines
    aside = to_reference[..., 1] * cosines - to_reference[..., 0] * sines
    turns = seen[:, None, 2] - known[None, :, 2]
    turns = np.abs(np.arctan2(np.sin(turns), np.cos(turns)))
    fits = (
        (np.abs(aside) <= settings.line_distance)
        & (turns <= settings.line_angle)
        & (np.abs(along_known) <= known[None, :, 3])
    )
    gaps = np.where(fits, np.abs(aside) + turns, np.inf)
    best = gaps.argmin(axis=1)
    which = np.flatnonzero(np.isfinite(gaps[np.arange(len(seen)), best]))
    return which.astype(np.int64), references[which], known[best[which], :3]
