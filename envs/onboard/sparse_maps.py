"""The sparse maps of the robots of all episodes, made from when they are first asked for."""

import math
from collections.abc import Hashable, Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.onboard.known_poses import KnownPoses
from lidarium.envs.onboard.people_in_sight import bodies_recognised
from lidarium.envs.onboard.radio.exchange import Exchange
from lidarium.envs.onboard.sparse_belief import SparseBelief
from lidarium.envs.onboard.sparse_shares import SparseShare
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.simulation.depth.point_cloud import camera_pose
from lidarium.envs.simulation.kernels.arrays import ENDED
from lidarium.envs.simulation.simulation import Simulation
from lidarium.mapping.geometry.rigid import Transform, composed, relative
from lidarium.mapping.grids.growing_array import GrowingArray
from lidarium.mapping.localization.localizer import KeyScans
from lidarium.mapping.localization.matching.wall_compass import wall_direction, within_quarter
from lidarium.mapping.point_clouds.cameras import points_of_depth
from lidarium.mapping.sparse.exploring.ground import (
    GroundCamera,
    SeenGround,
    are_seen_through,
    ground_map,
    joined_ground,
)
from lidarium.mapping.sparse.exploring.navigation import SparseNavigation, sparse_navigation
from lidarium.mapping.sparse.floor_plane import FloorPlane
from lidarium.mapping.sparse.mapper.incremental import IncrementalMapper
from lidarium.mapping.sparse.seen_floor import FloorPoints
from lidarium.mapping.sparse.settings import MapperSettings
from lidarium.mapping.sparse.sparse_map import SparseMap
from lidarium.mapping.sparse.swept_body import SweptBody

SEEN_MOTION_M, SEEN_TURN = 0.1, math.radians(5.0)
"""Minimum motion since the last image after which an image shows new ground [m, rad]."""

SHORTFALL = 0.4
"""Ground may be seen so far too near, as a share of a cell: less than from a wall to the cell behind it."""

LEAST_WALL_M, MOST_WALL_POINTS = 0.15, 3000
"""Minimum height of points that show walls [m], and maximum number of points that show their direction."""

LEAST_TURN = math.radians(1.0)
"""Walls that run along the axes of the believed poses to within this are taken to [rad]."""

TRAIL_M = 0.2
"""Distance between the places of the trail on which a robot can go back [m]."""

BODY_HEIGHT_MARGIN_M = 0.03
"""Maximum height above the body at which an overhanging object is in its way [m]."""

MERGE_RADIUS_M = 0.20
"""Free codes of a robot that drives on its map merge within this [m].

It needs them closer than a finished map does: with 0.25 m, robots that face a wall found no path past it.
"""


class SparseMapper:
    """Makes the sparse map of one robot.

    Boxes of codes lie along axes, so that walls which run otherwise would become thick: the map's axes are
    those of the walls that the first image shows.

    Parameters
    ----------
    settings : ExplorationSettings
        The robot, its camera, and how it maps.
    axes : float or None
        Direction of the map's x axis in the frame of the robot's believed poses [rad]; both have one origin.
        None for that of the walls.

    Attributes
    ----------
    axes : float or None
        The same, None before the first image.
    ground : SeenGround
        The ground that it has seen.
    version : int
        Incremented when map or ground changes.
    corrections : int
        Number of corrections of past poses.

    Raises
    ------
    ValueError
        If the robot has no depth camera, or one that sees no ground.
    """

    def __init__(self, settings: ExplorationSettings, axes: float | None = None) -> None:
        camera, sparse = settings.camera, settings.sparse_map
        if camera is None:
            raise ValueError(
                "the robots have no depth camera, which sparse maps are made by; want one, such as "
                "camera='xtion' with observe=[..., 'depth']"
            )
        self._mount, self._intrinsics, self._range = camera_pose(camera), camera.intrinsics, camera.depth_max
        mapping = MapperSettings(
            mode=sparse.mode,
            robot_height_m=settings.robot.height,
            range_m=camera.depth_max,
            most_boxes=sparse.most_boxes,
            least_motion_m=sparse.least_motion_m,
            least_turn=sparse.least_turn,
            merge_radius_m=MERGE_RADIUS_M,
            # On board, the seen ground tells of the floor, and boxes that are seen through are removed.
            floor_gap_m=0.0,
            fits_boxes=False,
        )
        # The camera is fixed to its robot, and the robot is on the floor.
        self._mapper = IncrementalMapper(sparse.codes, mapping, floor=FloorPlane())
        eye = GroundCamera(
            intrinsics=camera.intrinsics,
            pose=self._mount,
            shape=(camera.rows, camera.columns),
            range_m=camera.depth_max,
            lowest_m=-mapping.noise_depth_m,
            highest_m=mapping.floor_height_m,
            shortfall_m=SHORTFALL * sparse.cell_m,
        )
        self.ground = SeenGround(eye, settings.robot.radius, sparse.cell_m)
        self._times, self._poses = GrowingArray((), np.float64), GrowingArray((3,), np.float64)
        # At which steps images were coded, and showed new ground.
        self._coded: list[int] = []
        self._viewed: list[int] = []
        self._share: SparseShare | None = None
        self.axes, self.version, self.corrections = axes, 0, 0

    @property
    def map(self) -> SparseMap | None:
        """The map; None before the first image that shows anything."""
        return self._mapper.map if self._coded else None

    @property
    def record(self) -> SparseMap | None:
        """The map with the floor that was seen, for a file: each cell of seen ground counts as a point of floor."""
        made, ground = self.map, self.ground
        if made is None:
            return None
        rows, columns = np.nonzero(ground.cells)
        middles = (np.column_stack([columns, rows]) + ground.low + 0.5) * ground.cell_m
        points = FloorPoints(ground.cell_m)
        points.add(np.pad(middles, ((0, 0), (0, 1))), made.floor)
        return replace(made, seen_floor=points.seen(made.boxes, made.floor, made.settings.floor_height_m))

    def share(self) -> SparseShare:
        """Return the map as it is now, to be sent or combined; it stays as it is."""
        if self._share is None or self._share.version != self.version:
            made, ground = self.map, self.ground
            self._share = SparseShare(
                boxes=np.empty((0, 2, 3)) if made is None else made.boxes,
                trail=self.trail,
                free=np.empty((0, 3)) if made is None else made.free,
                cells=ground.cells.copy(),
                low=ground.low.copy(),
                cell_m=ground.cell_m,
                axes=self.axes or 0.0,
                version=self.version,
            )
        return self._share

    @property
    def trail(self) -> NDArray[np.float64]:
        """Trail of the robot on the map, one pose every ``TRAIL_M``, the latest last, (T, 3) [m]."""
        poses = self._poses.rows
        steps = np.hypot(*np.diff(poses[:, :2], axis=0, prepend=poses[:1, :2]).T)
        firsts = np.unique(np.floor(np.cumsum(steps) / TRAIL_M), return_index=True)[1]
        return np.pad(poses[firsts, :2], ((0, 0), (0, 1)))

    def sense(
        self,
        time_s: float,
        pose: NDArray[np.float64],
        depth: NDArray[np.float32] | None,
        bodies: NDArray[np.float64],
    ) -> None:
        """Add the pose of the robot and the image of its camera.

        Parameters
        ----------
        time_s : float
            When, later than all before [s].
        pose : (3,) float64
            x, y, theta as the robot believes [m, rad].
        depth : (rows, columns) float32 or None
            The image [m]; None if the camera took no image in this step.
        bodies : (K, 3) float64
            x, y and radius of other robots, people and doors, which are not mapped [m].
        """
        if self.axes is None and depth is not None:
            self.axes = self._axes_of_walls(pose, depth)
            self._poses.rows[:] = self._on_map(self._poses.rows)
        pose = self._on_map(pose)
        self._times.append(time_s)
        self._poses.append(pose)
        if depth is None:
            return
        step, frame = len(self._times) - 1, self._frame(pose)
        if self._is_new_view(pose):
            self.ground.add(pose, depth)
            self._viewed.append(step)
            self._forget_what_is_gone(depth, frame)
            self.version += 1
        if self._mapper.is_due(frame):
            points = self._usable_points(depth, frame, bodies)
            if len(points) and self._mapper.add(points, frame):
                self._coded.append(step)
                self.version += 1

    def correct(self, scans: KeyScans) -> None:
        """Move the map with the poses of the scans, as they are believed now.

        Each pose of the robot moves with the last scan before it.
        """
        times, poses, scan_poses = self._times.rows, self._poses.rows, self._on_map(scans.poses)
        scan = np.searchsorted(scans.times_s, times, side="right") - 1
        step = np.searchsorted(times, scans.times_s[np.maximum(scan, 0)])
        # A scan from before this map was begun, or without a step of its own, moves nothing.
        is_known = (scan >= 0) & (step < len(times))
        is_known[is_known] &= times[step[is_known]] == scans.times_s[scan[is_known]]
        beside = relative(poses[step[is_known]], poses[is_known])
        corrected = poses.copy()
        corrected[is_known] = composed(scan_poses[scan[is_known]], beside)
        poses[:] = corrected
        if self._coded:
            self._mapper.correct(np.stack([self._frame(pose) for pose in poses[self._coded]]))
        self.ground.move(poses[self._viewed])
        self.version += 1
        self.corrections += 1

    def _forget_what_is_gone(self, depth: NDArray[np.float32], frame: NDArray[np.float64]) -> None:
        """Remove the boxes of objects that have moved, such as other robots."""
        if self._coded:
            boxes = self._mapper.map.boxes
            gone = are_seen_through(boxes, depth, self._intrinsics, frame, self._range)
            if gone.any():
                self._mapper.forget(gone)

    def _on_map(self, poses: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return believed poses (..., 3) along the axes of the map [m, rad]."""
        return composed(np.array([0.0, 0.0, -(self.axes or 0.0)]), poses)

    def _axes_of_walls(self, pose: NDArray[np.float64], depth: NDArray[np.float32]) -> float:
        """Return in which direction the walls of an image run [rad]; 0 if they hardly differ from that."""
        points = points_of_depth(depth, self._intrinsics) @ self._mount[:3, :3].T + self._mount[:3, 3]
        upright = points[points[:, 2] >= LEAST_WALL_M, :2]
        chosen = np.ascontiguousarray(upright[:: len(upright) // MOST_WALL_POINTS + 1], np.float64)
        direction, information = wall_direction(chosen)
        axes = within_quarter(float(pose[2]) + direction)
        return float(axes) if information > 0.0 and abs(axes) >= LEAST_TURN else 0.0

    def _is_new_view(self, pose: NDArray[np.float64]) -> bool:
        if not self._viewed:
            return True
        last = self._poses.rows[self._viewed[-1]]
        turned = abs(math.remainder(float(pose[2] - last[2]), 2.0 * math.pi))
        return math.dist(pose[:2], last[:2]) >= SEEN_MOTION_M or turned >= SEEN_TURN

    def _frame(self, pose: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the pose (4, 4) of the camera of a robot at x, y, theta (3,)."""
        base = np.eye(4)
        cosine, sine = math.cos(pose[2]), math.sin(pose[2])
        base[:2, :2], base[:2, 3] = [[cosine, -sine], [sine, cosine]], pose[:2]
        return np.asarray(base @ self._mount)

    def _usable_points(
        self, depth: NDArray[np.float32], frame: NDArray[np.float64], bodies: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return the points of an image within range that are not on the bodies (K, 3)."""
        points = points_of_depth(depth, self._intrinsics).astype(np.float64)
        points = points[np.einsum("ij,ij->i", points, points) <= self._range**2]
        if len(bodies) == 0 or len(points) == 0:
            return np.asarray(points)
        places = points @ frame[:2, :3].T + frame[:2, 3]
        is_body = np.zeros(len(points), np.bool_)
        centres = Transform(0.0, 0.0, -(self.axes or 0.0)).apply(bodies[:, :2])
        for centre, radius in zip(centres, bodies[:, 2], strict=True):
            is_body |= np.hypot(*(places - centre).T) <= radius
        return np.asarray(points[~is_body])


def _now(mapper: SparseMapper) -> SparseShare:
    """Return a robot's map with its trail up to now."""
    return replace(mapper.share(), trail=mapper.trail)


def _sparse_body(settings: ExplorationSettings) -> SweptBody:
    """Return the body by which a robot plans on sparse maps."""
    return SweptBody(radius=settings.robot.radius, height=settings.robot.height + BODY_HEIGHT_MARGIN_M)


BODY_MARGIN_M = 0.1
"""Points within this distance of another robot's body count as that robot [m]."""

HEARD_MARGIN_M = 0.4
"""The same if only an earlier position of the other robot is known [m]."""


class SparseMaps:
    """Sparse maps by row = episode * robots + robot.

    Robots that know each other's starts combine their maps as the radio brings them; robots that do not are given the
    maps of those with whom they were joined, with the transform that was found.

    Parameters
    ----------
    simulation : Simulation
        The simulation with the images.
    settings : ExplorationSettings
        The team of every episode.
    poses : KnownPoses
        Poses of the robots and others as known to the robots.
    exchanges : list of Exchange
        The radio traffic of each episode; none if the radio is ideal.
    """

    def __init__(
        self, simulation: Simulation, settings: ExplorationSettings, poses: KnownPoses, exchanges: list[Exchange]
    ) -> None:
        self._simulation, self._settings, self._known_poses, self._exchanges = simulation, settings, poses, exchanges
        self._mappers: dict[int, SparseMapper] = {}
        self._received: dict[int, dict[int, tuple[SparseShare, Transform]]] = {}
        self._made: dict[tuple[int, bool], tuple[Hashable, SparseNavigation]] = {}
        self._is_common = settings.known_starts and settings.robots > 1 and settings.radio.is_ideal

    def start(self, rows: Iterable[int]) -> None:
        """Begin the episode of some rows; no maps are requested yet."""
        for row in rows:
            self._mappers.pop(row, None)
            self._received.pop(row, None)
            for shares_map in (False, True):
                self._made.pop((row, shares_map), None)

    @property
    def made(self) -> dict[int, SparseMapper]:
        """The mappers of the requested maps, by row."""
        return dict(self._mappers)

    def check(self) -> None:
        """Check that the robots can make sparse maps."""
        SparseMapper(self._settings)

    def of(self, row: int) -> SparseMapper:
        """Return the mapper of a robot; the first call creates it."""
        mapper = self._mappers.get(row)
        if mapper is None:
            # Robots that have one map have common axes.
            team = self._team(row) if self._is_common else ()
            common = [self._mappers[each].axes for each in team if each in self._mappers]
            mapper = self._mappers[row] = SparseMapper(self._settings, common[0] if common else None)
            self._sense(row, mapper)
        return mapper

    def belief(self, row: int, shares_map: bool = True) -> SparseBelief:
        """Return the belief of a robot, in its map frame, up to date; with others' maps if the team shares its maps.

        The first call lets the robot make a map, with ``shares_map`` all robots of its team.
        """
        own = self.of(row)
        mappers = [self.of(each) for each in self._team(row)] if shares_map else [own]
        if shares_map and self._is_common:
            # The team has one map, in the order of its robots.
            shares, place = [(_now(mapper), Transform()) for mapper in mappers], self._team(row).start
        else:
            shares, place = [(_now(own), Transform()), *(self._others(row) if shares_map else ())], row
        axes = own.axes or 0.0
        key = (axes, tuple((share.version, share.axes, transform) for share, transform in shares))
        made = self._made.get((place, shares_map))
        if made is None or made[0] != key:
            onto = Transform(0.0, 0.0, -axes)
            moved = [share.moved(onto @ transform @ Transform(0.0, 0.0, share.axes)) for share, transform in shares]
            made = self._made[place, shares_map] = (key, self._navigation(moved, own.trail))
        x, y = self._known_poses.offset(row)
        frame = Transform(-float(x), -float(y)) @ Transform(0.0, 0.0, axes)
        return SparseBelief(replace(made[1], trail=own.trail), frame, own.ground.camera, own.corrections)

    def share(self, row: int) -> SparseShare | None:
        """Return the map that a robot has made so far; None if it makes none."""
        return self._mappers[row].share() if row in self._mappers else None

    def shares(self, episode: int) -> list[SparseShare | None]:
        """Return the maps of the robots of an episode; empty if nobody makes one."""
        team = self._team(episode * self._settings.robots)
        return [self.share(row) for row in team] if any(row in self._mappers for row in team) else []

    def receive(self, row: int, other: int, share: SparseShare | None, own_from_other: Transform) -> None:
        """Give a robot the map of another, and how the other's map frame lies in its own."""
        if share is not None and other != row:
            self._received.setdefault(row, {})[other] = (share, own_from_other)

    def forget_others(self, row: int) -> None:
        """Let a robot forget the maps that it was given."""
        self._received.pop(row, None)

    def _others(self, row: int) -> list[tuple[SparseShare, Transform]]:
        """Return the maps of others that have reached a robot, and how their believed poses lie in its own."""
        if not self._settings.known_starts:
            return [given for _, given in sorted(self._received.get(row, {}).items())]
        if not self._exchanges:
            return []
        episode, robot = divmod(row, self._settings.robots)
        copies = self._exchanges[episode].sparse[robot]
        return [(share, Transform()) for other, share in enumerate(copies) if other != robot and share is not None]

    def sense(self, runs: NDArray[np.bool_] | None = None) -> None:
        """Process the last step, of all episodes or of those with ``runs`` (episodes,)."""
        for row, mapper in self._mappers.items():
            is_live = not self._simulation.world.flags[row] & ENDED
            if is_live and (runs is None or runs[row // self._settings.robots]):
                self._sense(row, mapper)

    def correct(self, row: int, scans: KeyScans) -> None:
        """Move a robot's map with the poses of its past, as its localizer believes them now."""
        if row in self._mappers:
            self._mappers[row].correct(scans)

    def _team(self, row: int) -> range:
        """Return the rows of a robot's team."""
        robots = self._settings.robots
        first = row // robots * robots
        return range(first, first + robots)

    def _sense(self, row: int, mapper: SparseMapper) -> None:
        camera = self._simulation.camera
        assert camera is not None
        step = int(self._simulation.world.steps[row // self._settings.robots])
        depth = camera.frames[row] if camera.taken_at[row] == step else None
        pose = self._simulation.beliefs.believed[row].copy()
        mapper.sense(step * self._settings.time_step, pose, depth, self._bodies(row))

    def _bodies(self, row: int) -> NDArray[np.float64]:
        """Return who is known to stand around a robot, with a margin, (K, 3) [m]."""
        camera = self._settings.camera
        assert camera is not None
        people = bodies_recognised(self._simulation, row, camera.depth_max)
        return np.concatenate([self._teammates(row), people + np.array([0.0, 0.0, BODY_MARGIN_M])])

    def _teammates(self, row: int) -> NDArray[np.float64]:
        """Return the known positions of other robots, with a margin around them, (K, 3) [m]."""
        known, robots = self._known_poses, self._settings.robots
        if not self._settings.known_starts:
            return np.empty((0, 3))
        margin = BODY_MARGIN_M if known.knows_teammates else HEARD_MARGIN_M
        first, contact = row // robots * robots, self._simulation.beliefs.contact[row]
        return np.array(
            [
                [*known.pose_known_to(row, first + other)[:2], self._settings.robot.radius + margin]
                for other in range(robots)
                if first + other != row and (known.knows_teammates or contact[other])
            ]
        ).reshape(-1, 3)

    def _navigation(self, shares: list[SparseShare], trail: NDArray[np.float64]) -> SparseNavigation:
        """Return the combined map of some robots, along the same axes."""
        boxes = np.concatenate([share.boxes for share in shares])
        # A robot can drive along its trail.
        nodes = np.concatenate([*(share.trail for share in shares), *(share.free for share in shares)])
        body, sparse = _sparse_body(self._settings), self._settings.sparse_map
        cells, low = joined_ground(shares)
        x, y = (low * sparse.cell_m).tolist()
        ground = ground_map(cells, (x, y), sparse.cell_m, boxes, body)
        return sparse_navigation(nodes, boxes, ground, trail, body, sparse.margin_m)
