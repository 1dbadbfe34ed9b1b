"""Scans, odometry, transforms, maps and paths as messages of ROS 2, and bags of these: MCAP files.

``rosbags`` encodes the messages; ``mcap`` writes the file, with the checksums that ``rosbags`` leaves out.
"""

import io
import math
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lidarium.extras import install_command
from lidarium.mapping.files.bags.messages import (
    CLOCK,
    GRID,
    LASER_SCAN,
    ODOMETRY,
    PATH,
    POSE_STAMPED,
    TRANSFORMS,
    TWIST,
    TWIST_STAMPED,
    typestore,
)
from lidarium.mapping.files.laser_logs import LaserLog
from lidarium.mapping.files.output import write_whole
from lidarium.mapping.grids.occupancy import FREE, OCCUPIED, UNKNOWN
from lidarium.mapping.grids.scan_geometry import ScanGeometry

_NANO = 1_000_000_000

_GRID_LEVELS = np.full(256, -1, np.int8)
_GRID_LEVELS[[OCCUPIED, UNKNOWN, FREE]] = 100, -1, 0


class MessageWriter(ABC):
    """Makes messages of what robots measure and believe, and writes them; times are in seconds."""

    def __init__(self) -> None:
        self._store = typestore()

    @abstractmethod
    def _write(self, topic: str, name: str, time_s: float, **fields: Any) -> None:  # noqa: ANN401
        """Write a message of a type to a topic."""

    def scan(
        self,
        topic: str,
        frame: str,
        time_s: float,
        ranges: NDArray[np.float32],
        geometry: ScanGeometry,
        beam_interval_s: float = 0.0,
        period_s: float | None = None,
    ) -> None:
        """Write a scan; the time is that of its last beam, beams without return are inf [m].

        The time from scan to scan is that of its beams by default.
        """
        increment, beams = geometry.angle_increment, geometry.beams
        self._write(
            topic,
            LASER_SCAN,
            time_s,
            header=self._header(frame, time_s - beam_interval_s * (beams - 1)),
            angle_min=geometry.angle_first,
            angle_max=geometry.angle_first + increment * (beams - 1),
            angle_increment=increment,
            time_increment=beam_interval_s,
            scan_time=beam_interval_s * beams if period_s is None else period_s,
            range_min=geometry.range_min,
            range_max=geometry.range_max,
            ranges=np.asarray(ranges, np.float32),
            intensities=np.zeros(0, np.float32),
        )

    def odometry(
        self,
        topic: str,
        frame: str,
        child: str,
        time_s: float,
        pose: ArrayLike,
        velocity: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        """Write the pose of a robot in a frame by its odometry, x, y, theta, and its velocity [m, rad, m/s, rad/s]."""
        unknown, twist = np.zeros(36), self._made(TWIST, **self._twist(velocity))
        self._write(
            topic,
            ODOMETRY,
            time_s,
            header=self._header(frame, time_s),
            child_frame_id=child,
            pose=self._made("geometry_msgs/msg/PoseWithCovariance", pose=self._pose(pose), covariance=unknown),
            twist=self._made("geometry_msgs/msg/TwistWithCovariance", twist=twist, covariance=unknown),
        )

    def transform(
        self,
        frame: str,
        child: str,
        time_s: float,
        pose: ArrayLike,
        *,
        height: float = 0.0,
        is_static: bool = False,
        topic: str | None = None,
    ) -> None:
        """Write the pose of a frame in another one: x, y, theta [m, rad], and its height [m].

        By default to ``/tf``, or to ``/tf_static``.
        """
        stamped = self._stamped(frame, child, time_s, pose, height)
        self._write(topic or ("/tf_static" if is_static else "/tf"), TRANSFORMS, time_s, transforms=[stamped])

    def mounts(self, frames: Mapping[str, str], time_s: float, height: float) -> None:
        """Write that frames, each by the frame that it is fixed to, are at the same place at a height [m]."""
        stamped = [self._stamped(frame, child, time_s, np.zeros(3), height) for frame, child in frames.items()]
        self._write("/tf_static", TRANSFORMS, time_s, transforms=stamped)

    def grid(
        self,
        topic: str,
        frame: str,
        time_s: float,
        levels: NDArray[np.uint8],
        origin: ArrayLike,
        resolution: float,
    ) -> None:
        """Write a map of three levels (0 occupied, 127 unknown, 255 free); row 0 has the lowest y."""
        rows, columns = levels.shape
        info = self._made(
            "nav_msgs/msg/MapMetaData",
            map_load_time=self._time(time_s),
            resolution=resolution,
            width=columns,
            height=rows,
            origin=self._pose([*np.asarray(origin, np.float64), 0.0]),
        )
        data = _GRID_LEVELS[levels].ravel()
        self._write(topic, GRID, time_s, header=self._header(frame, time_s), info=info, data=data)

    def velocity(self, topic: str, frame: str | None, time_s: float, velocity: tuple[float, float]) -> None:
        """Write a wanted speed and turn rate [m/s, rad/s]; stamped if the robot's frame is given."""
        if frame is None:
            self._write(topic, TWIST, time_s, **self._twist(velocity))
        else:
            twist = self._made(TWIST, **self._twist(velocity))
            self._write(topic, TWIST_STAMPED, time_s, header=self._header(frame, time_s), twist=twist)

    def goal(self, topic: str, frame: str, time_s: float, pose: ArrayLike) -> None:
        """Write a pose x, y, theta to drive to [m, rad]."""
        self._write(topic, POSE_STAMPED, time_s, header=self._header(frame, time_s), pose=self._pose(pose))

    def clock(self, time_s: float) -> None:
        """Write the simulated time."""
        self._write("/clock", CLOCK, time_s, clock=self._time(time_s))

    def path(self, topic: str, frame: str, time_s: float, times: Sequence[float], poses: NDArray[np.float64]) -> None:
        """Write a path: poses (n, 3) with their times (n,) [m, rad, s]."""
        stamped = [
            self._made("geometry_msgs/msg/PoseStamped", header=self._header(frame, when), pose=self._pose(pose))
            for when, pose in zip(times, poses, strict=True)
        ]
        self._write(topic, PATH, time_s, header=self._header(frame, time_s), poses=stamped)

    def _made(self, name: str, **fields: Any) -> Any:  # noqa: ANN401
        """Return a message of some type."""
        return self._store.types[name](**fields)

    def _header(self, frame: str, time_s: float) -> Any:  # noqa: ANN401
        return self._made("std_msgs/msg/Header", stamp=self._time(time_s), frame_id=frame)

    def _time(self, time_s: float) -> Any:  # noqa: ANN401
        seconds, nanoseconds = divmod(max(round(time_s * _NANO), 0), _NANO)
        return self._made("builtin_interfaces/msg/Time", sec=seconds, nanosec=nanoseconds)

    def _stamped(self, frame: str, child: str, time_s: float, pose: ArrayLike, height: float) -> Any:  # noqa: ANN401
        position, orientation = _in_space(pose, height)
        transform = self._made(
            "geometry_msgs/msg/Transform",
            translation=self._made("geometry_msgs/msg/Vector3", **position),
            rotation=self._made("geometry_msgs/msg/Quaternion", **orientation),
        )
        return self._made(
            "geometry_msgs/msg/TransformStamped",
            header=self._header(frame, time_s),
            child_frame_id=child,
            transform=transform,
        )

    def _twist(self, velocity: tuple[float, float]) -> dict[str, Any]:
        """Return the fields of a motion at a speed ahead and a turn rate [m/s, rad/s]."""
        speed, turn_rate = (float(value) for value in velocity)
        ahead = self._made("geometry_msgs/msg/Vector3", x=speed, y=0.0, z=0.0)
        return {"linear": ahead, "angular": self._made("geometry_msgs/msg/Vector3", x=0.0, y=0.0, z=turn_rate)}

    def _pose(self, pose: ArrayLike) -> Any:  # noqa: ANN401
        position, orientation = _in_space(pose)
        return self._made(
            "geometry_msgs/msg/Pose",
            position=self._made("geometry_msgs/msg/Point", **position),
            orientation=self._made("geometry_msgs/msg/Quaternion", **orientation),
        )


class BagWriter(MessageWriter):
    """Writes messages to an open file.

    Raises ValueError if the packages of the extra ``bags`` are not installed.
    """

    def __init__(self, file: BinaryIO) -> None:
        try:
            from mcap.writer import Writer

            super().__init__()
        except ImportError as error:
            raise ValueError(f"bags need the package {error.name}: {install_command('bags')}") from error
        self._writer: Any = Writer(file)
        self._writer.start(profile="ros2", library="lidarium")
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}

    def finish(self) -> None:
        """Write the index at the end."""
        self._writer.finish()

    def _write(self, topic: str, name: str, time_s: float, **fields: Any) -> None:  # noqa: ANN401
        if name not in self._schemas:
            definition, _ = self._store.generate_msgdef(name, ros_version=2)
            self._schemas[name] = self._writer.register_schema(name, "ros2msg", definition.encode())
        if topic not in self._channels:
            self._channels[topic] = self._writer.register_channel(topic, "cdr", self._schemas[name])
        content = self._store.serialize_cdr(self._made(name, **fields), name, little_endian=True)
        stamp = round(time_s * _NANO)
        self._writer.add_message(self._channels[topic], stamp, bytes(content), stamp)


def _in_space(pose: ArrayLike, height: float = 0.0) -> tuple[dict[str, float], dict[str, float]]:
    """Return the position and the quaternion of a pose x, y, theta [m, rad]."""
    x, y, theta = (float(value) for value in np.asarray(pose, np.float64))
    turn = {"x": 0.0, "y": 0.0, "z": math.sin(0.5 * theta), "w": math.cos(0.5 * theta)}
    return {"x": x, "y": y, "z": height}, turn


@contextmanager
def bag(path: Path) -> Iterator[BagWriter]:
    """Open a bag for writing; the file is written whole or not at all."""
    content = io.BytesIO()
    writer = BagWriter(content)
    yield writer
    writer.finish()
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_whole(path, content.getvalue())


def write_mcap_log(path: Path, log: LaserLog, robot: str = "robot") -> None:
    """Write a log of scans and odometry as an MCAP file, whole or not at all.

    Stamps are rounded to nanoseconds, angles of beams to single precision. Names of topics and frames begin with
    the name of the robot.
    """
    frames = {name: f"{robot}/{name}" for name in ("odom", "base_link", "laser")}
    # Messages of ROS have no times before zero.
    times = log.stamps - min(float(log.stamps[0]), 0.0)
    readings = (log.readings_stamps - min(float(log.stamps[0]), 0.0), log.readings)
    if not len(log.readings_stamps) and log.odometry is not None:
        readings = times, log.odometry
    with bag(path) as writer:
        writer.transform(frames["base_link"], frames["laser"], float(times[0]), log.laser_pose, is_static=True)
        for time_s, pose in zip(*readings, strict=True):
            if np.isfinite(pose).all() and time_s >= 0.0:
                writer.odometry(f"/{robot}/odom", frames["odom"], frames["base_link"], float(time_s), pose)
                writer.transform(frames["odom"], frames["base_link"], float(time_s), pose)
        for time_s, ranges in zip(times, log.ranges, strict=True):
            writer.scan(f"/{robot}/scan", frames["laser"], float(time_s), ranges, log.geometry, log.beam_interval_s)
