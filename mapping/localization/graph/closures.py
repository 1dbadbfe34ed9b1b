"""Place recognition: matches of a scan with old local maps, and their checks.

A closure counts if its scan agrees with the local map, does not lie in its free space, has no second place
that agrees nearly as well, and if it would move the robot far, or farther than it can have erred since,
only together with others that say the same.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.rigid import composed, relative, turned, wrapped
from lidarium.mapping.geometry.small_matrices import eigenvalues, inverse, squared
from lidarium.mapping.localization.matching.branch_and_bound import Pyramid, place, pyramid
from lidarium.mapping.localization.matching.local_mapping import Finished
from lidarium.mapping.localization.matching.scan_matching import Match, refine
from lidarium.mapping.localization.settings import ClosureSettings, MatchingSettings


@dataclass(frozen=True, slots=True, eq=False)
class Closure:
    """A place recognised.

    Attributes
    ----------
    old, new : int
        Nodes of the graph.
    measured : (3,) float64
        The new node as seen from the old one: x, y, theta [m, rad].
    covariance : (3, 3) float64
        How well, in the old node's frame [m^2, m rad, rad^2].
    score : float
        Agreement, from 0 to 1.
    """

    old: int
    new: int
    measured: NDArray[np.float64]
    covariance: NDArray[np.float64]
    score: float


@dataclass(frozen=True, slots=True, eq=False)
class _Remembered:
    coarse: Pyramid
    nodes: NDArray[np.int64]
    places: NDArray[np.float64]
    path: float


class ClosureFinder:
    """Finished local maps, and their matches with scans."""

    def __init__(self, settings: ClosureSettings, matching: MatchingSettings) -> None:
        self._settings, self._matching = settings, matching
        self._maps: list[_Remembered] = []
        # Closures that wait for others, each with the first node of its local map.
        self._doubtful: list[tuple[int, Closure]] = []

    def remember(self, finished: Finished, path: float) -> None:
        """Take in a finished local map, after so much way of the whole run [m]."""
        self._maps.append(_Remembered(pyramid(finished.grid), finished.nodes, finished.places, path))

    def find(
        self,
        poses: NDArray[np.float64],
        points: NDArray[np.float64],
        covariance: NDArray[np.float64],
        covariance_since: Callable[[int], NDArray[np.float64]],
        path: float,
        usual_score: float,
    ) -> list[Closure]:
        """Return the places that the last node's scan recognises.

        Parameters
        ----------
        poses : (nodes, 3) float64
            The graph's poses [m, rad].
        points : (n, 2) float64
            The last node's scan in its own frame [m].
        covariance : (3, 3) float64
            How well its pose is known.
        covariance_since : function of a node
            How well it is known as seen from that node, in its frame, (3, 3) [m^2, m rad, rad^2].
        path : float
            Way driven so far [m].
        usual_score : float
            Agreement of matches of late.
        """
        settings = self._settings
        variances = eigenvalues(covariance[:2, :2])
        reach_m = min(max(settings.deviations * float(np.sqrt(variances[-1])), settings.search_m), settings.most_m)
        reach_angle = min(
            max(settings.deviations * float(np.sqrt(covariance[2, 2])), settings.search_angle),
            settings.most_angle,
        )
        least_score = max(settings.least_score, settings.least_share * usual_score)
        closures = []
        for old, nearest in self._nearest(poses, path, settings.near_m + reach_m)[: settings.candidates]:
            closure = self._recognised(old, nearest, poses, points, (reach_m, reach_angle), least_score)
            if closure is not None:
                closures += self._confirmed(int(old.nodes[0]), closure, poses, covariance_since(closure.old))
        return closures

    def _nearest(self, poses: NDArray[np.float64], path: float, within: float) -> list[tuple[_Remembered, int]]:
        """Return old enough local maps near the last pose, the nearest first.

        Each has a node within a given distance; that node's index comes with it.
        """
        found = []
        for number, old in enumerate(self._maps):
            if path - old.path >= self._settings.path_m:
                distances = np.hypot(*(poses[old.nodes, :2] - poses[-1, :2]).T)
                nearest = int(distances.argmin())
                if distances[nearest] <= within:
                    found.append((float(distances[nearest]), number, nearest))
        return [(self._maps[number], nearest) for _, number, nearest in sorted(found)]

    def _recognised(
        self,
        old: _Remembered,
        nearest: int,
        poses: NDArray[np.float64],
        points: NDArray[np.float64],
        reach: tuple[float, float],
        least_score: float,
    ) -> Closure | None:
        settings = self._settings
        # What a local map holds lies right to the nodes near it: on a long way it may be bent.
        node, place_of_node = int(old.nodes[nearest]), old.places[nearest]
        around = composed(place_of_node, relative(poses[node], poses[-1]))
        least = 0.6 * least_score * settings.least_overlap
        best, _ = place(old.coarse, points, around, reach, least, settings.evaluations)
        if best is None:
            return None
        # Where nothing but odometry speaks, along a wall, a scan that is laid where the robot believes to be
        # stays there.
        weak = np.diag(1.0 / np.array([settings.search_m, settings.search_m, settings.search_angle]) ** 2)
        match, here = (
            self._matched_on(old, points, best.pose, np.zeros((3, 3))),
            self._matched_on(old, points, around, weak),
        )
        if here.contradiction <= settings.most_contradiction and here.score >= settings.as_good * match.score:
            # What the map knows agrees with where the robot believes to be; what lies beyond it may be the
            # other side of a wall.
            match = here
        if (
            match.score < least_score
            or match.overlap < settings.least_overlap
            or match.contradiction > settings.most_contradiction
        ):
            return None
        if reach[0] > settings.apart_m:
            apart = (best.pose, settings.apart_m, settings.apart_angle)
            second, is_over = place(
                old.coarse,
                points,
                around,
                reach,
                settings.ambiguity * best.score,
                settings.evaluations,
                apart,
            )
            if second is not None or not is_over:
                return None
        floor = np.diag(
            [settings.least_deviation_m**2, settings.least_deviation_m**2, settings.least_deviation_angle**2]
        )
        covariance = turned(match.covariance + floor, -float(place_of_node[2]))
        return Closure(node, len(poses) - 1, relative(place_of_node, match.pose), covariance, match.score)

    def _matched_on(
        self,
        old: _Remembered,
        points: NDArray[np.float64],
        start: NDArray[np.float64],
        information: NDArray[np.float64],
    ) -> Match:
        matching = self._matching
        return refine(
            old.coarse.grid,
            points,
            start,
            start,
            information,
            matching.weight(len(points)),
            matching.unseen,
            matching.surface_m,
        )

    def _confirmed(
        self, first_node: int, closure: Closure, poses: NDArray[np.float64], covariance: NDArray[np.float64]
    ) -> list[Closure]:
        """Return the closure, and those that waited for it.

        Nothing if it has to wait for others itself.

        Parameters
        ----------
        first_node : int
            The first one of its local map.
        closure : Closure
            The recognised places.
        poses : (nodes, 3) float64
            The graph's poses [m, rad].
        covariance : (3, 3) float64
            How well the new node is known as seen from the old one, without the closure [m^2, m rad, rad^2].
        """
        settings = self._settings
        move = (closure.measured - relative(poses[closure.old], poses[closure.new]))[:2]
        deviations = math.sqrt(squared(inverse((covariance + closure.covariance)[:2, :2]), move))
        is_improbable = deviations > settings.confirmed_beyond_deviations
        if np.hypot(move[0], move[1]) <= settings.confirmed_beyond_m and not is_improbable:
            return [closure]
        agreeing = [(first, other) for first, other in self._doubtful if self._agree(other, closure, poses)]
        # One local map may resemble another place, to all scans that are taken there.
        is_single = (is_improbable or settings.doubts_one_map) and all(first == first_node for first, _ in agreeing)
        if len(agreeing) + 1 < settings.confirmations or is_single:
            self._doubtful = [*self._doubtful[-20:], (first_node, closure)]
            return []
        self._doubtful = []
        return [*(other for _, other in agreeing), closure]

    def _agree(self, first: Closure, second: Closure, poses: NDArray[np.float64]) -> bool:
        """Whether two closures place the way between their new nodes as it was driven."""
        ends = [composed(poses[closure.old], closure.measured) for closure in (first, second)]
        driven = relative(poses[first.new], poses[second.new])
        gap = relative(ends[0], ends[1]) - driven
        settings = self._settings
        return bool(
            np.hypot(gap[0], gap[1]) <= settings.agree_m and abs(wrapped(float(gap[2]))) <= settings.agree_angle
        )
