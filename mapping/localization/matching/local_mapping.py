"""A robot's local pose, by matching scans with local maps.

Local maps begin and end along the path.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.rigid import relative, turned
from lidarium.mapping.geometry.small_matrices import inverse
from lidarium.mapping.grids.scan_geometry import ScanGeometry
from lidarium.mapping.localization.matching.branch_and_bound import place, pyramid
from lidarium.mapping.localization.matching.scan_matching import Match, refine
from lidarium.mapping.localization.matching.scan_search import search
from lidarium.mapping.localization.matching.submaps import AgreementGrid, Submap
from lidarium.mapping.localization.settings import SlamSettings


class _LocalMatcher:
    """Lays scans on a local map, and knows how well they have agreed of late.

    Attributes
    ----------
    usual_score : float
        Agreement of matches of late.
    contradiction : float
        Share of the last scan's returns that lay, from where odometry led, in cells that the local map knows to be
        free.
    recoveries : int
        Scans that were found in another direction or place than odometry said, as nothing there agreed.
    explains : bool
        Whether the last match explains enough of its scan.
    """

    def __init__(self, settings: SlamSettings, geometry: ScanGeometry) -> None:
        self._matching, self._uses_odometry, self._geometry = (
            settings.matching,
            settings.uses_odometry,
            geometry,
        )
        self.usual_score, self.contradiction, self.recoveries = 0.0, 0.0, 0
        self.explains = True

    def match(
        self,
        submap: Submap,
        points: NDArray[np.float64],
        predicted: NDArray[np.float64],
        moved: NDArray[np.float64],
        uncertainty: NDArray[np.float64] | None,
        failed: int,
    ) -> Match | None:
        """Return the pose of a scan on a local map; None if it does not match.

        The search begins near the pose by odometry, weighing both. If that does not convince, odometry
        may be wrong (a wheel slips, the robot was pushed), and the search goes farther, without it, for scans
        of enough returns; a match there has to be clearly better. On new ground, and if a scan
        hardly has a return, only odometry measures the robot's pose.

        Parameters
        ----------
        submap : Submap
            The local map.
        points : (n, 2) float64
            Points in the robot's frame [m].
        predicted : (3,) float64
            Expected pose of the robot, in the local map's frame [m, rad].
        moved : (3,) float64
            The motion since the last match that led there.
        uncertainty : (3, 3) float64
            Covariance of that motion, in the robot's frame at its end [m^2, m rad, rad^2]; None if odometry does not
            measure it.
        failed : int
            How many scans in a row did not match before.
        """
        settings = self._matching
        is_blind = uncertainty is None or failed >= settings.wide_after
        near = None if uncertainty is None else self._match_near(submap, points, predicted, uncertainty)
        self.contradiction = 1.0 if near is None else near.contradiction
        is_sparse = near is not None and len(points) < settings.wide_share * self._geometry.beams
        if near is not None and self._is_new_ground(near, len(points)):
            nothing = np.zeros((3, 3))
            unmatched = Match(predicted, near.score, near.overlap, near.contradiction, nothing, near.prior)
            known = None
            if not is_sparse:
                known = self._beside_odometry(submap, points, predicted, moved, near)
                known = known or self._beyond_odometry(submap, points, predicted)
            return unmatched if known is None else self._noted(known)
        if near is not None and self._is_good(near) and near.score >= settings.convincing_share * self.usual_score:
            self.explains = self._explains(near)
            return self._noted(near)
        reach = (settings.blind_m, settings.blind_angle) if is_blind else self._reach(moved)
        far = None if is_sparse else self._match_far(submap, points, predicted, reach)
        if uncertainty is not None and is_blind and far is not None:
            # So far from odometry something a little similar, or in part, is soon found.
            is_alike = (
                far.score >= settings.convincing_share * self.usual_score and far.overlap >= settings.blind_overlap
            )
            far = far if is_alike else None
        good = [match for match in (near, far) if match is not None and self._is_good(match)]
        found = good[0] if good else None
        if len(good) == 2 and _outweighs(good[1], good[0], settings.better_by):
            found = good[1]
        if self._uses_odometry and not is_sparse and not self._explains(found):
            found = self._beyond_odometry(submap, points, predicted) or found
        self.explains = self._explains(found)
        return None if found is None else self._noted(found)

    def _explains(self, match: Match | None) -> bool:
        """Whether a match explains enough of a scan: points near known cells, and their agreement."""
        least = self._matching.explained_share * self.usual_score
        return match is not None and match.score * match.overlap >= least

    def _beside_odometry(
        self,
        submap: Submap,
        points: NDArray[np.float64],
        predicted: NDArray[np.float64],
        moved: NDArray[np.float64],
        near: Match,
    ) -> Match | None:
        """Return the match of a scan that seems to see new ground, as far as odometry may be wrong, or None.

        Few points of a scan at a wrong heading lie near what the map holds, although most of them show it.
        """
        settings = self._matching
        match = self._match_far(submap, points, predicted, self._reach(moved))
        if match is None or not self._is_good(match):
            return None
        alike = settings.convincing_share * self.usual_score
        is_known = match.score >= alike and match.overlap >= settings.known_overlap
        # What the map does hold of new ground agrees where odometry leads.
        contradicts = near.score < alike and match.overlap >= settings.clearer_overlap
        is_clearer = match.score * match.overlap >= settings.clearer * near.score * near.overlap
        if not (is_known or (contradicts and is_clearer)):
            return None
        self.recoveries += 1
        return match

    def _beyond_odometry(
        self, submap: Submap, points: NDArray[np.float64], predicted: NDArray[np.float64]
    ) -> Match | None:
        """Return the match in any direction that alone explains most of a scan, or None.

        Odometry may not know of a motion at all: a robot was turned by hand, or scans are missing.
        """
        settings = self._matching
        reach, alike = (settings.blind_m, math.pi), settings.convincing_share * self.usual_score
        coarse, least = pyramid(submap.finished()), 0.6 * settings.blind_overlap * alike
        best, is_over = place(coarse, points, predicted, reach, least, settings.lost_evaluations)
        if best is None or not is_over:
            return None
        match = self._refined(submap, points, best.pose)
        if (
            match.score < max(alike, settings.least_score)
            or match.overlap < settings.blind_overlap
            or match.contradiction > settings.most_contradiction
        ):
            return None
        apart = (best.pose, settings.apart_m, settings.apart_angle)
        second, is_over = place(
            coarse,
            points,
            predicted,
            reach,
            settings.ambiguity * best.score,
            settings.lost_evaluations,
            apart,
        )
        if second is not None or not is_over:
            return None
        self.recoveries += 1
        return match

    def _reach(self, moved: NDArray[np.float64]) -> tuple[float, float]:
        """Return how far to search without odometry, [m] and [rad]."""
        settings, distance = self._matching, math.hypot(float(moved[0]), float(moved[1]))
        # Twice the motion and more: also where a robot is that went back while odometry said forth.
        return (
            min(settings.search_m + 2.2 * distance, settings.blind_m),
            min(
                settings.search_angle + 2.2 * abs(float(moved[2])) + settings.search_turn * distance,
                settings.blind_angle,
            ),
        )

    def _noted(self, match: Match) -> Match:
        self.usual_score = match.score if self.usual_score == 0.0 else 0.9 * self.usual_score + 0.1 * match.score
        return match

    def _is_new_ground(self, match: Match, points: int) -> bool:
        """Whether a scan sees hardly anything that the local map has observed.

        Also true if it sees hardly anything at all.
        """
        settings = self._matching
        is_sparse = points < min(settings.least_points, self._geometry.beams // 8)
        return is_sparse or (
            match.overlap < settings.least_overlap and match.contradiction <= settings.most_contradiction
        )

    def _is_good(self, match: Match) -> bool:
        settings = self._matching
        least_score = max(settings.least_score, settings.least_share * self.usual_score)
        agrees = match.score >= least_score and match.overlap >= settings.least_overlap
        return agrees and match.contradiction <= settings.most_contradiction

    def _match_near(
        self,
        submap: Submap,
        points: NDArray[np.float64],
        predicted: NDArray[np.float64],
        uncertainty: NDArray[np.float64],
    ) -> Match:
        settings, grid = self._matching, submap.grid
        spread = np.sqrt(np.diag(uncertainty))
        # Odometry that leaps leads nowhere, and is not sought farther than where there is none.
        reach_m = min(
            settings.search_m + settings.search_deviations * float(spread[:2].max()),
            max(settings.search_m, settings.blind_m),
        )
        reach_angle = min(
            settings.search_angle + settings.search_deviations * float(spread[2]),
            max(settings.search_angle, settings.blind_angle),
        )
        information = turned(inverse(uncertainty), float(predicted[2]))
        weight = settings.weight(len(points))
        start = search(grid, points, predicted, reach_m, reach_angle, information, weight, settings.unseen)
        return refine(grid, points, start, predicted, information, weight, settings.unseen, settings.surface_m)

    def _match_far(
        self,
        submap: Submap,
        points: NDArray[np.float64],
        predicted: NDArray[np.float64],
        reach: tuple[float, float],
    ) -> Match | None:
        settings = self._matching
        least = 0.5 * settings.least_score * settings.least_overlap
        found, _ = place(pyramid(submap.finished()), points, predicted, reach, least, settings.evaluations)
        return None if found is None else self._refined(submap, points, found.pose)

    def _refined(self, submap: Submap, points: NDArray[np.float64], pose: NDArray[np.float64]) -> Match:
        """Return the match near a pose (3,), without odometry."""
        settings, nothing = self._matching, np.zeros((3, 3))
        weight = settings.weight(len(points))
        return refine(submap.grid, points, pose, pose, nothing, weight, settings.unseen, settings.surface_m)

    def judge(self, submap: Submap, points: NDArray[np.float64], pose: NDArray[np.float64]) -> None:
        """Note how well points (n, 2) agree with a local map near a pose (3,) found otherwise."""
        match = self._refined(submap, points, pose)
        if self._is_good(match) and not self._is_new_ground(match, len(points)):
            self._noted(match)

    def match_first(self, submap: Submap, points: NDArray[np.float64]) -> Match | None:
        """Return the present pose of the first scan of a local map on that map.

        Its points are (n, 2) [m]. None if they do not match.
        """
        settings, nowhere = self._matching, np.zeros(3)
        grid = submap.grid
        weight = settings.weight(len(points))
        match = refine(grid, points, nowhere, nowhere, np.zeros((3, 3)), weight, settings.unseen, settings.surface_m)
        return match if self._is_good(match) and not self._is_new_ground(match, len(points)) else None


def _outweighs(far: Match, near: Match, better_by: float) -> bool:
    """Return whether a match outweighs odometry, which then has to be wrong.

    The match against odometry must be better than one with it by enough.

    If nearly all of a scan lies near known walls, and elsewhere only a part of it, that part may agree
    better by chance, as on the other side of a wall: all points together must not agree less.
    """
    return far.score > near.score + better_by and far.score * far.overlap >= near.score * near.overlap


@dataclass(slots=True, eq=False)
class _Active:
    """A local map that still grows.

    Attributes
    ----------
    submap : Submap
        Its contents.
    node : int
        Node of the graph in whose frame it is.
    in_older : (3,) float64
        That node in the frame of the local map before.
    nodes : list of int
        That node, and those that were set since.
    places : list of (3,) float64
        Their poses in the local map's frame.
    path : float
        Way driven since [m].
    """

    submap: Submap
    node: int
    in_older: NDArray[np.float64]
    nodes: list[int]
    places: list[NDArray[np.float64]]
    path: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Finished:
    """A local map that is finished.

    Attributes
    ----------
    grid : AgreementGrid
        Its contents.
    nodes : (nodes,) int64
        Nodes of the graph that were set while it grew; in the frame of the first it is.
    places : (nodes, 3) float64
        Where they lay in its frame then: what it holds near them lies right to them, whatever is believed of
        the way between them later.
    """

    grid: AgreementGrid
    nodes: NDArray[np.int64]
    places: NDArray[np.float64]


class LocalMapper:
    """Two growing local maps; the older one gives the robot's pose."""

    def __init__(self, settings: SlamSettings, geometry: ScanGeometry) -> None:
        self._matching, self._submaps = settings.matching, settings.submaps
        self._geometry = geometry
        self._active: list[_Active] = []
        self._matcher = _LocalMatcher(settings, geometry)

    @property
    def node(self) -> int:
        """Node that defines the frame of poses now."""
        return self._active[0].node

    def begin(self, node: int, ranges: NDArray[np.float32]) -> list[Finished]:
        """Begin again at a node, by the scan taken there.

        Return the local maps that this ends.
        """
        ended = self._ended(self._active)
        self._active = []
        self._add(node, np.zeros(3), ranges)
        return ended

    @property
    def usual_score(self) -> float:
        """Agreement of matches of late."""
        return self._matcher.usual_score

    @property
    def contradiction(self) -> float:
        """How much the last scan contradicted the local map, see ``_LocalMatcher``."""
        return self._matcher.contradiction

    @property
    def recoveries(self) -> int:
        """How many scans were found elsewhere than odometry said, see ``_LocalMatcher``."""
        return self._matcher.recoveries

    @property
    def explains(self) -> bool:
        """Whether the last match explains enough of its scan, see ``_LocalMatcher``."""
        return self._matcher.explains

    def match(
        self,
        points: NDArray[np.float64],
        predicted: NDArray[np.float64],
        moved: NDArray[np.float64],
        uncertainty: NDArray[np.float64] | None,
        failed: int,
    ) -> Match | None:
        """Return the pose of a scan on the older local map, see ``_LocalMatcher.match``."""
        return self._matcher.match(self._active[0].submap, points, predicted, moved, uncertainty, failed)

    def judge(self, points: NDArray[np.float64], pose: NDArray[np.float64]) -> None:
        """Note how well a scan agrees with the older local map at a pose found otherwise.

        Its points are (n, 2) [m]; the pose is x, y, theta (3,) in the map's frame [m, rad].
        """
        self._matcher.judge(self._active[0].submap, points, pose)

    def rendered_again(self, points: NDArray[np.float64]) -> Match | None:
        """Return the present pose of the older local map's first scan on that map.

        Its points are (n, 2) [m]. None if they do not match.
        """
        return self._matcher.match_first(self._active[0].submap, points)

    def insert(self, pose: NDArray[np.float64], path: float, ranges: NDArray[np.float32]) -> bool:
        """Insert a scan at x, y, theta (3,) in the older local map's frame.

        The robot has driven a given distance [m] since the last scan.
        """
        for active in self._active:
            pose = pose if active is self._active[0] else relative(active.in_older, pose)
            active.path += path
            if not active.submap.insert(pose, ranges, self._geometry, self._matching.range_m):
                return False
        return True

    def note_node(self, node: int, pose: NDArray[np.float64]) -> None:
        """Take in that a node was set at x, y, theta (3,) in the older local map's frame."""
        for active in self._active:
            pose = pose if active is self._active[0] else relative(active.in_older, pose)
            active.nodes.append(node)
            active.places.append(pose.copy())

    @property
    def wants_another(self) -> bool:
        """Whether it is time to begin another local map, at a new node."""
        newest = self._active[-1]
        is_full = (
            newest.submap.scans >= max(self._submaps.least_scans // 2, 1) and newest.path >= 0.5 * self._submaps.path_m
        )
        return len(self._active) == 1 and is_full

    def add(self, node: int, pose: NDArray[np.float64], ranges: NDArray[np.float32]) -> None:
        """Begin another local map at a node, by the scan taken there.

        The node lies at x, y, theta (3,) in the older local map's frame.
        """
        self._add(node, pose, ranges)

    def hand_over(self, poses: NDArray[np.float64]) -> tuple[NDArray[np.float64], list[Finished]]:
        """End the older local map if it is full.

        Return poses (n, 3) of its frame in that of the new older one, and the finished map.
        """
        oldest = self._active[0]
        is_full = oldest.submap.scans >= self._submaps.least_scans and oldest.path >= self._submaps.path_m
        if len(self._active) < 2 or not is_full:
            return poses, []
        self._active = self._active[1:]
        return relative(self._active[0].in_older, poses), self._ended([oldest])

    def _add(self, node: int, in_older: NDArray[np.float64], ranges: NDArray[np.float32]) -> None:
        reach = min(self._matching.range_m, self._geometry.range_max) + 2.0 * self._submaps.path_m
        active = _Active(Submap(self._submaps, reach), node, in_older.copy(), [node], [np.zeros(3)])
        active.submap.insert(np.zeros(3), ranges, self._geometry, self._matching.range_m)
        self._active.append(active)

    def _ended(self, active: list[_Active]) -> list[Finished]:
        ended = [one for one in active if one.submap.scans >= self._submaps.least_scans // 2]
        return [Finished(one.submap.finished(), np.array(one.nodes), np.stack(one.places)) for one in ended]


def way(motion: NDArray[np.float64]) -> float:
    """Return the length of a motion x, y, theta (3,) [m].

    Turns count as a metre per radian.
    """
    return math.hypot(float(motion[0]), float(motion[1])) + abs(float(motion[2]))
