"""The measurements of a robot of ROS 2: scans with the odometry of their time, from messages that may be invalid."""

import math
import time
from bisect import bisect_right
from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.ros.graph import Graph
from lidarium.envs.settings.lidar import MOST_RANGE_M
from lidarium.mapping.files.bags.frames import Frames, Mounting
from lidarium.mapping.files.bags.messages import LASER_SCAN, ODOMETRY, TRANSFORMS
from lidarium.mapping.files.bags.reading import directions_of, frame_of, in_plane, seconds_of
from lidarium.mapping.files.beams import WHOLE_TURN, Beams, from_right_to_left, marked, resampled, symmetric_scans
from lidarium.mapping.files.guarded_reading import printable
from lidarium.mapping.files.laser_logs import MAX_POSE_M
from lidarium.mapping.files.odometry_faults import odometry_at
from lidarium.mapping.geometry.rigid import composed, relative
from lidarium.mapping.grids.scan_geometry import MAX_BEAMS, ScanGeometry

_READINGS = 512
"""Readings of the odometry that are kept."""

_MAX_FRAMES = 256
"""Frames of transforms that are noted: a robot has tens."""

_MAX_NAMES = 512
"""Letters of the names of two frames."""

_MIN_STEP = 1e-4
"""Smallest step from beam to beam [rad]."""

_RESTARTS_AFTER = 10
"""Scans in order of time, all before the last one, after which the clock has been set back."""

_SET_BACK_S = 1.0
"""Odometry that is earlier than the last by this much is of a clock that was set back [s]."""

_MOUNT_S = 1.0
"""Time after the first scan in which the laser's place on the robot is awaited [s]."""

_CENTRED_M = 0.01
"""A laser that is nearer to the robot's middle is at it [m]."""


class Names(NamedTuple):
    """Topics and frames of a robot.

    Attributes
    ----------
    scan, odometry, command, goal : str
        Topics.
    base : str
        Frame of the body; empty for that of the odometry.
    map_frame : str
        Frame of the robot's pose in the transforms.
    map, own_map_frame : str
        Topic and frame of the robot's own map.
    transforms : str
        Topic of the transforms; fixed ones are on that with ``_static`` behind it.
    """

    scan: str
    odometry: str
    command: str
    goal: str
    base: str = ""
    map_frame: str = "map"
    map: str = "/map"
    own_map_frame: str = "map"
    transforms: str = "/tf"


def names_of(namespace: str, base: str = "", map_frame: str = "map", *, has_transforms: bool = False) -> Names:
    """Return the usual names below a namespace, which may be empty, and may have transforms of its own."""
    before = f"/{namespace.strip('/')}" if namespace.strip("/") else ""
    scan, odometry, command, goal, own = (
        f"{before}/{name}" for name in ("scan", "odom", "cmd_vel", "goal_pose", "map")
    )
    transforms = f"{before}/tf" if has_transforms else "/tf"
    return Names(scan, odometry, command, goal, base, map_frame, own, own.removeprefix("/"), transforms)


class Reading(NamedTuple):
    """A scan with the odometry of its time.

    Attributes
    ----------
    stamp_s : float
        Time of its last beam [s].
    ranges : (beams,) float32
        The scan in the robot's middle [m]; inf for no return, nan for an invalid beam.
    odometry : (3,) float64
        x, y, theta by the wheels [m, rad].
    velocity : (float, float)
        Speed and turn rate [m/s, rad/s].
    mapped : (3,) float64 or None
        x, y, theta in the map's frame [m, rad]; None if no transform gives it.
    """

    stamp_s: float
    ranges: NDArray[np.float32]
    odometry: NDArray[np.float64]
    velocity: tuple[float, float]
    mapped: NDArray[np.float64] | None


class Transforms:
    """The transforms on a topic, and on that of fixed ones, for all robots that use it."""

    def __init__(self, graph: Graph, topic: str = "/tf") -> None:
        self._graph, self._topics = graph, (topic, f"{topic}_static")
        self.frames = Frames()
        self.moving: dict[tuple[str, str], deque[tuple[float, tuple[float, float, float]]]] = {}
        self._known: set[tuple[str, str]] = set()
        for each in self._topics:
            graph.subscribe(each, TRANSFORMS)

    def hear(self) -> None:
        """Take new transforms."""
        for topic in self._topics:
            for message, *_ in self._graph.take(topic):
                for each in message.transforms:
                    self._note(topic, each)

    def _note(self, topic: str, each: Any) -> None:  # noqa: ANN401
        parent, child = frame_of(each.header.frame_id), frame_of(each.child_frame_id)
        if len(parent) + len(child) > _MAX_NAMES:
            self._graph.refuse(topic, "names of frames are too long")
            return
        if (parent, child) not in self._known and len(self._known) >= _MAX_FRAMES:
            self._graph.refuse(topic, f"more than {_MAX_FRAMES} frames")
            return
        pose = in_plane(each.transform.translation, each.transform.rotation)
        if not all(map(math.isfinite, pose)):
            self._graph.refuse(topic, "nan or infinite")
            return
        self._known.add((parent, child))
        is_static = topic.endswith("_static")
        self.frames.note(parent, child, each.transform, is_static=is_static)
        if not is_static:
            kept = self.moving.setdefault((parent, child), deque(maxlen=_READINGS))
            stamp = seconds_of(each.header.stamp)
            if kept and kept[-1][0] - stamp >= _SET_BACK_S:
                kept.clear()
            kept.append((stamp, pose))


class RobotLink:
    """The measurements of a robot, received as messages.

    Parameters
    ----------
    graph : Graph
        The node.
    names : Names
        Topics and frames.
    transforms : Transforms
        Those of the robot's topic.

    Attributes
    ----------
    geometry : ScanGeometry or None
        Beams of the readings: those of the first scan, until `use_geometry` sets others; None before that.
    odom_frame : str
        Frame of the odometry.
    scan_period_s : float
        Time between scans as the first one states it; 0 if it does not [s].
    remark : str
        Assumptions about the laser that its messages leave open; empty if there are none.
    """

    def __init__(self, graph: Graph, names: Names, transforms: Transforms) -> None:
        self._graph, self.names, self._transforms = graph, names, transforms
        graph.subscribe(names.scan, LASER_SCAN)
        graph.subscribe(names.odometry, ODOMETRY)
        self.geometry: ScanGeometry | None = None
        self.odom_frame, self.scan_period_s, self.remark = "", 0.0, ""
        self._has_topic, self._first_s = False, 0.0
        self._base, self._laser = names.base, ""
        self._mounting = Mounting(np.zeros(3), is_hanging=False)
        self._native, self._wanted, self._axis = Beams(0.0, 0.0), Beams(0.0, 0.0), 0.0
        self._stamps: list[float] = []
        self._wheels: list[_Wheels] = []
        self._waiting: deque[tuple[float, Any]] = deque(maxlen=8)
        self._last_s, self._early = -math.inf, 0

    def start(self) -> NDArray[np.float64] | None:
        """Return the pose in the map's frame, (3,), None if no transform gives it."""
        moves = self._transforms.moving.get((self.names.map_frame, self.odom_frame))
        return composed(np.array(moves[-1][1]), np.array(self._wheels[-1].pose)) if moves and self._wheels else None

    def begin(self) -> bool:
        """Learn the laser from the first scan; return whether all necessary messages have arrived.

        Raises ValueError if the laser cannot be used.
        """
        self._hear_odometry()
        self._hear_scans()
        if not self._waiting:
            return False
        scan = self._waiting[-1][1]
        self._laser = frame_of(scan.header.frame_id)
        self._base = self._base or self._transforms.frames.body(self._laser)
        self._hear_odometry()
        if not self._wheels:
            return False
        found = self._transforms.frames.mounting(self._base, self._laser)
        self._first_s = self._first_s or time.monotonic()
        if found is None and time.monotonic() - self._first_s < _MOUNT_S:
            return False
        self._mounting = found or self._mounting
        self.remark = (
            f"no transforms say where the laser ({printable(self._laser)}) is on the robot ({printable(self._base)}): "
            "it is taken as upright, in the robot's middle, looking ahead"
            if found is None and self._base != self._laser
            else ""
        )
        beams = self._beams(scan)
        if beams is None:
            self._waiting.pop()
            return False
        ranges, self._native = beams
        reach = max(float(scan.range_min), 0.0), min(_reach(scan), MOST_RANGE_M)
        try:
            _, self.geometry, self._axis, *_ = symmetric_scans(ranges[None], *self._native[:2], reach)
        except ValueError:  # looks backwards, for instance
            count = min(round(WHOLE_TURN / self._native.increment), MAX_BEAMS)
            self.geometry = ScanGeometry(beams=count, field_of_view=WHOLE_TURN, range_min=reach[0], range_max=reach[1])
        self._wanted = Beams(self.geometry.angle_first + self._axis, self.geometry.angle_increment)
        self.scan_period_s = float(scan.scan_time)
        return True

    @property
    def base_frame(self) -> str:
        """Frame of the body."""
        return self._base

    @property
    def stamp_s(self) -> float:
        """Stamp of the last usable scan [s]."""
        return max(self._last_s, 0.0)

    def use_geometry(self, geometry: ScanGeometry) -> None:
        """Let readings have these beams, as those of other robots of the team."""
        if geometry != self.geometry:
            self.geometry, self._axis = geometry, 0.0
            self._wanted = Beams(geometry.angle_first, geometry.angle_increment)

    def readings(self, patience_s: float = 0.05) -> list[Reading]:
        """Return the readings that are complete, in order of time.

        A scan waits for the odometry of its time, but not longer than the patience [s].
        """
        self._hear_odometry()
        self._hear_scans()
        found = []
        while self._waiting:
            came_s, scan = self._waiting[0]
            is_early = not self._stamps or self._stamps[-1] < _last_beam_s(scan)
            if is_early and time.monotonic() - came_s < patience_s:
                break
            self._waiting.popleft()
            reading = self._reading(scan)
            if reading is not None:
                found.append(reading)
        return found

    def _hear_scans(self) -> None:
        for message, *_ in self._graph.take(self.names.scan):
            self._waiting.append((time.monotonic(), message))

    def _hear_odometry(self) -> None:
        """Take the odometry that has come: of its topic or, as long as that is silent, of the transforms."""
        self._transforms.hear()
        for message, *_ in self._graph.take(self.names.odometry):
            pose = in_plane(message.pose.pose.position, message.pose.pose.orientation)
            twist = message.twist.twist
            self.odom_frame = frame_of(message.header.frame_id)
            self._base = self.names.base or frame_of(message.child_frame_id)
            velocity = (float(twist.linear.x), float(twist.angular.z))
            self._take_wheels(self.names.odometry, seconds_of(message.header.stamp), _Wheels(pose, velocity))
            self._has_topic = True
        if self._has_topic:
            return
        for (parent, child), moves in self._transforms.moving.items():
            if child == self._base and parent.rstrip("/").endswith("odom"):
                self.odom_frame = parent
                if self._stamps and self._stamps[-1] - moves[-1][0] >= _SET_BACK_S:
                    self._stamps, self._wheels = [], []
                for stamp, pose in moves:
                    if not self._stamps or stamp > self._stamps[-1]:
                        self._take_wheels(self.names.transforms, stamp, _Wheels(pose, self._speed(stamp, pose)))

    def _speed(self, stamp: float, pose: tuple[float, float, float]) -> tuple[float, float]:
        """Return speed and turn rate since the last reading [m/s, rad/s]."""
        if not self._stamps:
            return 0.0, 0.0
        moved = relative(np.array(self._wheels[-1].pose), np.array(pose)) / (stamp - self._stamps[-1])
        return float(moved[0]), float(moved[2])

    def _take_wheels(self, topic: str, stamp: float, wheels: "_Wheels") -> None:
        """Keep a reading of the odometry."""
        if not all(map(math.isfinite, (*wheels.pose, *wheels.velocity))) or math.hypot(*wheels.pose[:2]) > MAX_POSE_M:
            self._graph.refuse(topic, "not a pose in metres")
            return
        if self._stamps and stamp == self._stamps[-1]:
            return  # sent again
        if self._stamps and stamp < self._stamps[-1]:
            if self._stamps[-1] - stamp < _SET_BACK_S:
                self._graph.refuse(topic, "back in time")
                return
            self._stamps, self._wheels = [], []  # the clock has been set back
        self._stamps.append(stamp)
        self._wheels.append(wheels)
        if len(self._stamps) > 2 * _READINGS:
            del self._stamps[:_READINGS], self._wheels[:_READINGS]

    def _beams(self, scan: Any) -> tuple[NDArray[np.float32], Beams] | None:  # noqa: ANN401
        """Return a scan, counter-clockwise, and its directions against the robot; None if it has none."""
        beams = directions_of(scan, is_hanging=self._mounting.is_hanging)
        is_whole = beams is not None and len(scan.ranges) <= MAX_BEAMS and 0.0 <= scan.range_min < _reach(scan)
        if beams is None or not is_whole or not _MIN_STEP < abs(beams.increment) < WHOLE_TURN:
            self._graph.refuse(self.names.scan, "no beams that can be used")
            return None
        ranges, beams = from_right_to_left(np.array(scan.ranges, np.float32), beams)
        ranges = marked(np.array(ranges), float(scan.range_min), _reach(scan))
        return ranges, Beams(beams.angle_min + float(self._mounting.pose[2]), beams.increment)

    def _reading(self, scan: Any) -> Reading | None:  # noqa: ANN401
        """Return a scan with the odometry of its time; None if it is refused."""
        assert self.geometry is not None
        topic = self.names.scan
        if frame_of(scan.header.frame_id) != self._laser:
            self._graph.refuse(topic, "in another frame")
            return None
        stamp = _last_beam_s(scan)
        if stamp == self._last_s:
            return None  # sent again
        self._early = self._early + 1 if stamp < self._last_s else 0
        if 0 < self._early < _RESTARTS_AFTER:
            self._graph.refuse(topic, "back in time")
            return None
        beams = self._beams(scan)
        if beams is None or not self._stamps:
            return None
        ranges, directions = beams
        self._last_s, self._early = stamp, 0
        poses = np.array([wheels.pose for wheels in self._wheels])
        poses[:, 2] = np.unwrap(poses[:, 2])
        odometry = odometry_at(np.array(self._stamps), poses, np.array([stamp]))[0]
        is_native = len(ranges) == self.geometry.beams and np.allclose(directions[:2], self._wanted[:2], atol=1e-5)
        if not is_native:
            ranges = resampled(ranges, directions, self._wanted, self.geometry.beams)
        x, y, _ = self._mounting.pose.tolist()
        if math.hypot(x, y) > _CENTRED_M:
            ranges = _recentred(ranges, self.geometry, x, y)
        place = max(bisect_right(self._stamps, stamp) - 1, 0)
        ahead = np.array([0.0, 0.0, self._axis])
        moves = self._transforms.moving.get((self.names.map_frame, self.odom_frame))
        mapped = None if not moves else composed(composed(np.array(moves[-1][1]), odometry), ahead)
        return Reading(stamp, ranges, composed(odometry, ahead), self._wheels[place].velocity, mapped)


class _Wheels(NamedTuple):
    """A pose by the odometry and the velocity there [m, rad, m/s, rad/s]."""

    pose: tuple[float, float, float]
    velocity: tuple[float, float]


def _last_beam_s(scan: Any) -> float:  # noqa: ANN401
    interval = float(scan.time_increment)
    turning = max(interval, 0.0) * (len(scan.ranges) - 1) if math.isfinite(interval) else 0.0
    return seconds_of(scan.header.stamp) + turning


def _reach(scan: Any) -> float:  # noqa: ANN401
    """Return the range that means no return [m]; beyond every valid range if the header gives none."""
    stated = float(scan.range_max)
    return stated if 0.0 < stated < math.inf else 2.0 * MOST_RANGE_M


def connected(graph: Graph, team: Sequence[Names], timeout_s: float, *, on_map: bool = False) -> list[RobotLink]:
    """Return the links to all robots of a team, when each has sent a scan and its odometry.

    With ``on_map`` transforms must give the pose of each in the map's frame.

    Raises ValueError if one has not in time, or has a laser that cannot be used.
    """
    transforms = {topic: Transforms(graph, topic) for topic in {names.transforms for names in team}}
    links = [RobotLink(graph, names, transforms[names.transforms]) for names in team]
    until = time.monotonic() + timeout_s
    begun = [False] * len(links)
    while not all(begun):
        for k, link in enumerate(links):
            begun[k] = begun[k] or (link.begin() and not (on_map and link.start() is None))
        if time.monotonic() > until:
            silent = links[begun.index(False)].names
            refused = "; ".join(f"{reason} ({count} x)" for reason, count in graph.refused.items())
            raise ValueError(
                f"in domain {graph.domain} nothing usable came on {silent.scan} and {silent.odometry} "
                f"(or {silent.transforms}){f', or no transform from {silent.map_frame}' if on_map else ''} "
                f"within {timeout_s:g} s"
                f"{f' (refused: {refused})' if refused else ''}; want a robot that publishes both there, another "
                "--domain, or other --namespaces"
            )
        graph.wait(0.02)
    geometry = links[0].geometry
    assert geometry is not None
    for link in links[1:]:
        link.use_geometry(geometry)
    return links


def begin_driving(graph: Graph, topics: Mapping[str, str], timeout_s: float = 2.0) -> list[str]:
    """Publish topics of commands, by their types, before the first command; return those without subscribers.

    Raises ValueError if another node publishes one.
    """
    for topic, name in topics.items():
        if graph.publishers(topic):
            raise ValueError(f"{topic} is published by another node already; want one driver of each robot")
        graph.advertise(topic, name)
    until = time.monotonic() + timeout_s
    while time.monotonic() < until and not all(map(graph.subscribers, topics)):
        time.sleep(0.02)
    return [topic for topic in topics if not graph.subscribers(topic)]


def _recentred(ranges: NDArray[np.float32], geometry: ScanGeometry, x: float, y: float) -> NDArray[np.float32]:
    """Return a scan of a laser at (x, y) on the robot [m] as seen from the robot's middle, in the same directions.

    Of several returns in a direction the nearest counts; directions without any are invalid. Beams without return
    stay so: they are as good as parallel.
    """
    is_return = np.isfinite(ranges)
    place = ranges[is_return, None] * geometry.unit_vectors.T[is_return] + (x, y)
    bearing, distance = np.arctan2(place[:, 1], place[:, 0]), np.hypot(place[:, 0], place[:, 1])
    beams = np.round((bearing - geometry.angle_first) / geometry.angle_increment).astype(np.int64)
    if geometry.is_full_circle:
        beams %= geometry.beams
    is_seen = (beams >= 0) & (beams < geometry.beams)
    nearest = np.full(geometry.beams, np.inf)
    np.minimum.at(nearest, beams[is_seen], distance[is_seen])
    found = np.where(np.isposinf(ranges), np.inf, np.nan)
    return np.where(np.isfinite(nearest), nearest, found).astype(np.float32)
