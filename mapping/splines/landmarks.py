"""Points of a map of curves: corners or peaks."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.splines.features import match_points
from lidarium.mapping.splines.settings import MapSettings


@dataclass(frozen=True, slots=True, eq=False)
class Landmarks:
    """Points of the map: corners or peaks.

    Attributes
    ----------
    points : (n, 2) float64
        Their positions [m].
    weights : (n,) float64
        How much is known of each, as a number of observations with a standard deviation of 1 cm.
    counts : (n,) int64
        How many scans have seen each.
    last_seen : (n,) int64
        The map's update that saw each last.
    """

    points: NDArray[np.float64]
    weights: NDArray[np.float64]
    counts: NDArray[np.int64]
    last_seen: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.points)

    def updated(
        self,
        seen: NDArray[np.float64],
        sigmas: NDArray[np.float64],
        update: int,
        most_distance: float,
        settings: MapSettings,
    ) -> "Landmarks":
        """Return the landmarks updated by seen points (m, 2), without noise.

        The points have standard deviations (m,) [m]. Landmarks that were only noise are removed.
        """
        weights = (0.01 / sigmas) ** 2
        which, known = match_points(seen, self.points, most_distance)
        points, all_weights, counts, last_seen = (
            self.points.copy(),
            self.weights.copy(),
            self.counts.copy(),
            self.last_seen.copy(),
        )
        share = (weights[which] / (weights[which] + all_weights[known]))[:, None]
        points[known] += share * (seen[which] - points[known])
        all_weights[known] = np.minimum(all_weights[known] + weights[which], settings.most_weight)
        counts[known] += 1
        last_seen[known] = update
        # What is near a known one, but not the nearest, is none of its own.
        is_new = np.ones(len(seen), np.bool_)
        if len(self.points) and len(seen):
            is_new = np.linalg.norm(seen[:, None] - self.points[None], axis=2).min(axis=1) >= most_distance
        is_kept = (counts >= settings.trusted_count) | (last_seen > update - settings.trial_updates)
        added = int(is_new.sum())
        return Landmarks(
            np.concatenate([points[is_kept], seen[is_new]]),
            np.concatenate([all_weights[is_kept], weights[is_new]]),
            np.concatenate([counts[is_kept], np.ones(added, np.int64)]),
            np.concatenate([last_seen[is_kept], np.full(added, update, np.int64)]),
        )

    def moved(self, pose: Transform) -> "Landmarks":
        """Return the landmarks in the frame in which their own has a pose."""
        return Landmarks(pose.apply(self.points), self.weights, self.counts, self.last_seen)

    def within(self, reach: float) -> "Landmarks":
        """Return those in a square around the origin of which half the side is given [m]."""
        return self.chosen(np.abs(self.points).max(axis=1, initial=0.0) <= reach)

    def chosen(self, which: NDArray[np.bool_]) -> "Landmarks":
        """Return some of the landmarks, by a mask (n,)."""
        return Landmarks(self.points[which], self.weights[which], self.counts[which], self.last_seen[which])

    def joined(self, others: "Landmarks", most_distance: float, most_weight: float) -> "Landmarks":
        """Return these and other landmarks of the same frame; those that are near each other are one [m]."""
        which, known = match_points(others.points, self.points, most_distance)
        weights, counts, last_seen = self.weights.copy(), self.counts.copy(), self.last_seen.copy()
        points, share = self.points.copy(), others.weights[which] / (others.weights[which] + weights[known])
        points[known] += share[:, None] * (others.points[which] - points[known])
        weights[known] = np.minimum(weights[known] + others.weights[which], most_weight)
        counts[known] += others.counts[which]
        last_seen[known] = np.maximum(last_seen[known], others.last_seen[which])
        rest = np.ones(len(others), np.bool_)
        rest[which] = False
        added = others.chosen(rest)
        return Landmarks(
            np.concatenate([points, added.points]),
            np.concatenate([weights, added.weights]),
            np.concatenate([counts, added.counts]),
            np.concatenate([last_seen, added.last_seen]),
        )


def no_landmarks() -> Landmarks:
    """Return landmarks of a blank map."""
    return Landmarks(np.empty((0, 2)), np.empty(0), np.empty(0, np.int64), np.empty(0, np.int64))
