"""The path of a robot as a graph of nodes, with the local maps and closures on it.

Whoever knows how the robot moves in a local map's frame hands in scans at their poses there. Local maps begin
and end, nodes are set, places are recognised, and all nodes are brought to agree.
"""

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.rigid import Transform, composed, relative
from lidarium.mapping.geometry.small_matrices import product
from lidarium.mapping.grids.growing_array import GrowingArray
from lidarium.mapping.grids.occupancy import OccupancyGrid, OccupancySettings
from lidarium.mapping.grids.scan_geometry import ScanGeometry
from lidarium.mapping.localization.graph.closures import Closure, ClosureFinder
from lidarium.mapping.localization.graph.node_graph import NodeGraph
from lidarium.mapping.localization.localizer import KeyScans
from lidarium.mapping.localization.matching.local_mapping import Finished, LocalMapper, way
from lidarium.mapping.localization.matching.scan_points import scan_points
from lidarium.mapping.localization.matching.wall_compass import WallCompass
from lidarium.mapping.localization.odometry import compounded
from lidarium.mapping.localization.settings import SlamSettings


class _LoopClosing:
    """Finds closures, and keeps them until their time has come."""

    def __init__(self, settings: SlamSettings) -> None:
        self._delay_s = settings.closures.delay_s
        self._finder = ClosureFinder(settings.closures, settings.matching)
        self._due: list[tuple[float, Closure]] = []

    @property
    def pending(self) -> int:
        """How many closures were found that have not acted yet."""
        return len(self._due)

    def remember(self, ended: list[Finished], path: float) -> None:
        """Take in finished local maps, after so much of the whole path [m]."""
        for finished in ended:
            self._finder.remember(finished, path)

    def find(
        self, graph: NodeGraph, points: NDArray[np.float64], path: float, usual_score: float, time_s: float
    ) -> None:
        """Find the places that the last node's scan recognises.

        Parameters
        ----------
        graph : NodeGraph
            The nodes.
        points : (n, 2) float64
            The last node's scan in its own frame [m].
        path : float
            Length of the path so far [m].
        usual_score : float
            Agreement of matches of late.
        time_s : float
            Now [s].
        """
        for closure in self._finder.find(
            graph.nodes, points, graph.covariance, graph.covariance_since, path, usual_score
        ):
            self._due.append((time_s + self._delay_s, closure))

    def take_due(self, time_s: float) -> list[Closure]:
        """Return the closures that are due, once."""
        acting = [closure for due, closure in self._due if due <= time_s]
        if acting:
            self._due = [(due, closure) for due, closure in self._due if due > time_s]
        return acting


class _ScanHistory:
    """Matched scans, each with the node before it and its pose in that node's frame.

    Parameters
    ----------
    geometry : ScanGeometry
        Directions of the beams.
    resolution : float
        Side of the map's cells [m].
    """

    def __init__(self, geometry: ScanGeometry, resolution: float) -> None:
        self._geometry, self._resolution = geometry, resolution
        self._nodes, self._poses = GrowingArray((), np.int64), GrowingArray((3,), np.float64)
        self._ranges = GrowingArray((geometry.beams,), np.float32)
        self._times = GrowingArray((), np.float64)
        self._map, self._mapped = OccupancyGrid(), 0

    def append(self, node: int, pose: NDArray[np.float64], ranges: NDArray[np.float32], time_s: float) -> None:
        """Take in a scan that was taken at a time [s]."""
        self._nodes.append(node)
        self._poses.append(pose)
        self._ranges.append(ranges)
        self._times.append(time_s)

    def scans(self, nodes: NDArray[np.float64]) -> KeyScans:
        """Return all scans at their poses, by the poses of the nodes (n, 3) [m, rad]."""
        poses = composed(nodes[self._nodes.rows], self._poses.rows)
        return KeyScans(poses, self._ranges.rows, self._times.rows)

    def since(self, node: int) -> NDArray[np.int64]:
        """Return the numbers of the scans that were taken at a node or after it."""
        return np.flatnonzero(self._nodes.rows >= node)

    def map(self, nodes: NDArray[np.float64]) -> OccupancyGrid:
        """Return the map of all scans, by the poses of the nodes (n, 3) [m, rad]."""
        if self._mapped == 0:
            self._map = OccupancyGrid(OccupancySettings(resolution=self._resolution))
        scans = self.scans(nodes)
        for pose, ranges in zip(scans.poses[self._mapped :], scans.ranges[self._mapped :], strict=True):
            self._map.integrate(pose, ranges, self._geometry)
        self._mapped = len(self._ranges)
        return self._map

    def discard_map(self) -> None:
        """Render the map again when it is next asked for: nodes have moved."""
        self._mapped = 0


class _ScanSampling:
    """Samples the points of scans, in the robot's frame."""

    def __init__(self, settings: SlamSettings, geometry: ScanGeometry) -> None:
        self._settings, self._geometry = settings, geometry
        self._unit_vectors = geometry.unit_vectors

    def points(self, ranges: NDArray[np.float32], spacing_m: float, limit: int) -> NDArray[np.float64]:
        """Return representative points in which beams ended, (n, 2) [m], thinned to few."""
        longest = min(self._settings.matching.range_m, self._geometry.range_max)
        return scan_points(ranges, self._unit_vectors, self._geometry.angle_increment, longest, spacing_m, limit)

    def all_points(self, ranges: NDArray[np.float32]) -> NDArray[np.float64]:
        """Return nearly all points in which beams ended.

        They serve estimates that are made once per run and gain from each point, such as the direction of
        walls.
        """
        return self.points(ranges, self._settings.compass.spacing_m, self._geometry.beams)


class _WallSurvey:
    """Surveys the directions of walls, and compares later scans with them.

    Attributes
    ----------
    compass : WallCompass or None
        Directions of walls; None if they are not used.
    """

    def __init__(self, settings: SlamSettings, sampling: _ScanSampling) -> None:
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

    def survey(self, length_m: float, node: int, history: _ScanHistory, nodes: NDArray[np.float64]) -> None:
        """Survey the directions of walls in the local map of a node, if it is time to.

        If none do, survey again after as much of the path.
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


class MappedPath:
    """The path so far, and the scans on it.

    Parameters
    ----------
    settings : SlamSettings
        How local maps are made, places recognised and nodes brought to agree.
    geometry : ScanGeometry
        Directions of the beams.
    pose : (3,) float64
        Start of the path: x, y, theta [m, rad].
    finds_start : bool
        Whether the start is corrected by the map that the path begins; not if poses are those of a known map.

    Attributes
    ----------
    mapper : LocalMapper
        The local maps that grow.
    sampling : ScanSampling
        Samples the points of scans.
    local, matched, at_node : (3,) float64
        Poses in the frame of the older local map: now, at the last scan that was taken in, at the last node
        [m, rad]. The owner moves the first.
    spread : (3, 3) float64
        Covariance of the motion from the last node to the last scan [m^2, m rad, rad^2].
    length : float
        Length of the path; turns count as a metre per radian [m].
    closures, corrections : int
        Closures that have acted, and how often the past was corrected.
    """

    def __init__(
        self, settings: SlamSettings, geometry: ScanGeometry, pose: NDArray[np.float64], *, finds_start: bool = True
    ) -> None:
        self._settings, self._finds_start, self.sampling = settings, finds_start, _ScanSampling(settings, geometry)
        self.mapper = LocalMapper(settings, geometry)
        self._loops = _LoopClosing(settings)
        self._walls = _WallSurvey(settings, self.sampling)
        self._graph = NodeGraph(settings.graph, self._walls.compass, pose)
        self._history = _ScanHistory(geometry, settings.submaps.resolution)
        # The first scan's points and pose, until the map shows how well they match.
        self._first: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None
        self.local, self.matched, self.at_node = np.zeros(3), np.zeros(3), np.zeros(3)
        self.spread = np.zeros((3, 3))
        self.length, self.closures, self.corrections = 0.0, 0, 0
        self._is_corrected = self._has_begun = False

    @property
    def last_node(self) -> int:
        """Number of the last node."""
        return len(self._graph.nodes) - 1

    @property
    def mapper_node(self) -> int:
        """The node of the older local map's frame; the path's beginning before there is one."""
        return self.mapper.node if self._has_begun else 0

    @property
    def place(self) -> tuple[int, NDArray[np.float64]]:
        """The last node, and the robot's pose x, y, theta (3,) in its frame.

        Later corrections of the node apply to the robot as well.
        """
        return self.last_node, relative(self.at_node, self.local)

    @property
    def pose(self) -> NDArray[np.float64]:
        """x, y, theta of the robot, shape (3,) [m, rad]."""
        node, pose = self.place
        return composed(self._graph.nodes[node], pose)

    @property
    def nodes(self) -> NDArray[np.float64]:
        """Poses of all nodes as they are now believed, shape (nodes, 3) [m, rad]."""
        return self._graph.nodes.copy()

    @property
    def pending(self) -> int:
        """How many closures were found that have not acted yet."""
        return self._loops.pending

    @property
    def key_scans(self) -> KeyScans:
        """All scans that were taken in, at their poses as believed now."""
        return self._history.scans(self._graph.nodes)

    @property
    def map(self) -> OccupancyGrid:
        """The map of all scans that were taken in, rendered again after corrections."""
        return self._history.map(self._graph.nodes)

    def take_correction(self) -> KeyScans | None:
        """Return all scans at their poses, once after each time the past was corrected; else None."""
        if not self._is_corrected:
            return None
        self._is_corrected = False
        return self.key_scans

    def covariance(self, spread: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the covariance (3, 3) of the pose [m^2, m rad, rad^2].

        That of the motion since the last node is given, in the node's frame.
        """
        node, pose = self.place
        return compounded(self._graph.nodes[node], self._graph.covariance, pose, spread)

    def begin(self, ranges: NDArray[np.float32], covariance: NDArray[np.float64], time_s: float) -> NDArray[np.float64]:
        """Begin the first local map at the robot's pose, at a node of its own.

        The covariance (3, 3) of its motion from the path's beginning is given. Return the new local map's
        frame, (3,), as seen from the one before.
        """
        self._has_begun = True
        self.note_key(ranges, time_s)
        if self._finds_start:
            self._first = self.sampling.all_points(ranges), self.local.copy()
        return self._begin_maps(ranges, self.motion_covariance(covariance, self.local))

    def restart(
        self, ranges: NDArray[np.float32], covariance: NDArray[np.float64], time_s: float
    ) -> NDArray[np.float64]:
        """Begin new local maps at the robot's pose, as ``begin`` does; learned calibration is kept."""
        self._first = None
        self._walls.restart(self.length)
        frame = self._begin_maps(ranges, covariance)
        self.note_key(ranges, time_s)
        return frame

    def take(
        self,
        pose: NDArray[np.float64],
        covariance: NDArray[np.float64],
        ranges: NDArray[np.float32],
        points: NDArray[np.float64],
        time_s: float,
    ) -> NDArray[np.float64] | None:
        """Take in a scan.

        Parameters
        ----------
        pose, covariance : (3,) and (3, 3) float64
            Its pose, in the frame of the older local map, and how well the motion there from the
            last node is known [m, rad].
        ranges : (beams,) float32
            The scan [m].
        points : (n, 2) float64
            Few points of it in the robot's frame, by which places are recognised [m].
        time_s : float
            When [s].

        Returns
        -------
        (3,) float64 or None
            Frame of the local map that is now the older one, as seen from the one before, where that has
            changed.
        """
        driven = way(relative(self.matched, pose))
        self.length += driven
        self.local, self.matched, self.spread = pose, pose.copy(), covariance
        if not self.mapper.insert(pose, driven, ranges):
            since = relative(self.at_node, self.local)
            return self.restart(ranges, self.motion_covariance(covariance, since), time_s)
        self._walls.observe(ranges, relative(self.at_node, self.local))
        if self._first is not None and self.length >= self._settings.graph.start_path_m:
            self._find_start(*self._first)
        self._walls.survey(self.length, self.mapper.node, self._history, self._graph.nodes)
        self._set_node(covariance, ranges, points, time_s)
        self.note_key(ranges, time_s)
        poses, ended = self.mapper.hand_over(np.stack([self.local, self.matched, self.at_node, np.zeros(3)]))
        self.local, self.matched, self.at_node = poses[0], poses[1], poses[2]
        self._loops.remember(ended, self.length)
        return relative(poses[3], np.zeros(3)) if poses[3].any() else None

    def correct(self, time_s: float) -> None:
        """Let closures act that are due; all if the time is inf."""
        acting = self._loops.take_due(time_s)
        if not acting and not (time_s == np.inf and self._graph.has_waiting):
            return
        self.closures += len(acting)
        is_due = self._graph.close(acting) if acting else True
        if is_due or time_s == np.inf:
            self._graph.settle(len(acting))
            self._note_correction()

    def motion_covariance(self, matched: NDArray[np.float64], since: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return how well the motion between two nodes is known, both by matches."""
        graph = self._settings.graph
        along = (graph.deviation_m + graph.deviation_per_metre * float(np.hypot(since[0], since[1]))) ** 2
        turned = np.eye(3)
        cosine, sine = np.cos(self.at_node[2]), np.sin(self.at_node[2])
        turned[:2, :2] = [[cosine, sine], [-sine, cosine]]
        return np.diag([along, along, graph.deviation_angle**2]) + product(turned, matched, turned.T)

    def note_key(self, ranges: NDArray[np.float32], time_s: float) -> None:
        """Keep a scan for the map, at the robot's pose."""
        node, pose = self.place
        self._history.append(node, pose, ranges, time_s)

    def _set_node(
        self,
        covariance: NDArray[np.float64],
        ranges: NDArray[np.float32],
        points: NDArray[np.float64],
        time_s: float,
    ) -> None:
        """Set a node at the robot's pose, if it is far enough from the last one or a local map begins."""
        graph = self._settings.graph
        since = relative(self.at_node, self.local)
        wants_another = self.mapper.wants_another
        if wants_another or np.hypot(since[0], since[1]) >= graph.distance_m or abs(since[2]) >= graph.angle:
            self._add_node(since, self.motion_covariance(covariance, since))
            self.mapper.note_node(self.last_node, self.local)
            if wants_another:
                self.mapper.add(self.last_node, self.local, ranges)
            self._loops.find(self._graph, points, self.length, self.mapper.usual_score, time_s)

    def _begin_maps(self, ranges: NDArray[np.float32], covariance: NDArray[np.float64]) -> NDArray[np.float64]:
        """Begin new local maps by a scan, at a new node at the robot's pose.

        The covariance of its motion since the last node is given.
        """
        frame = self.local
        self._add_node(relative(self.at_node, self.local), covariance)
        self._loops.remember(self.mapper.begin(self.last_node, ranges), self.length)
        self.local, self.matched, self.at_node = np.zeros(3), np.zeros(3), np.zeros(3)
        return frame

    def _add_node(self, since: NDArray[np.float64], covariance: NDArray[np.float64]) -> None:
        """Set a node at the robot's pose, at a distance from the last one."""
        self._graph.add(since, covariance)
        self.at_node = self.local.copy()
        self.spread = np.zeros((3, 3))

    def _find_start(self, points: NDArray[np.float64], pose: NDArray[np.float64]) -> None:
        """Match the first scan with the map to correct the start.

        The map was begun by few scans, whose errors displace the scan from the robot's start.
        """
        self._first = None
        match = self.mapper.rendered_again(points) if self.mapper.node == 1 else None
        if match is not None:
            self._graph.begin_at(composed(pose, relative(match.pose, np.zeros(3))))
            self._note_correction()

    def _note_correction(self) -> None:
        self.corrections += 1
        self._history.discard_map()
        self._is_corrected = True
