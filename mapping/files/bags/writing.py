"""Writes bags: scans, odometry, transforms, maps and paths as messages of ROS 2."""

import io
import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lidarium.mapping.files.bags import schemas
from lidarium.mapping.files.bags.cdr import Cdr
from lidarium.mapping.files.laser_logs import LaserLog
from lidarium.mapping.files.output import write_whole
from lidarium.mapping.grids.occupancy import FREE, OCCUPIED, UNKNOWN
from lidarium.mapping.grids.scan_geometry import ScanGeometry

NANO = 1_000_000_000
"""Nanoseconds in a second."""

_NOTHING = [0.0] * 36
"""Covariances that nobody knows."""

_LATCHED = "/tf_static"

_GRID_LEVELS = np.full(256, -1, np.int8)
_GRID_LEVELS[[OCCUPIED, UNKNOWN, FREE]] = 100, -1, 0


class BagWriter:
    """Writes messages to an open file; times are seconds.

    Parameters
    ----------
    file : BinaryIO
        Where to.

    Raises
    ------
    ValueError
        Where the packages of the extra ``mcap`` are not installed.
    """

    def __init__(self, file: BinaryIO) -> None:
        try:
            from mcap.writer import Writer
        except ImportError as error:
            raise ValueError('bags need the package mcap; pip install "lidarium[mcap]"') from error
        self._writer: Any = Writer(file)
        self._writer.start(profile="ros2", library="lidarium")
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}

    def finish(self) -> None:
        """Write the index at the end."""
        self._writer.finish()

    def scan(
        self,
        topic: str,
        frame: str,
        time_s: float,
        ranges: NDArray[np.float32],
        geometry: ScanGeometry,
        beam_interval_s: float = 0.0,
    ) -> None:
        """Write a scan; the time is that of its last beam, beams without return are inf [m]."""
        message = _header(frame, time_s - beam_interval_s * (geometry.beams - 1))
        increment, beams = geometry.angle_increment, geometry.beams
        message.numbers("f", geometry.angle_first, geometry.angle_first + increment * (beams - 1), increment)
        message.numbers("f", beam_interval_s, beam_interval_s * beams, geometry.range_min, geometry.range_max)
        message.array(np.asarray(ranges, np.float32)).array(np.zeros(0, np.float32))
        self._write(topic, schemas.LASER_SCAN, time_s, message)

    def odometry(self, topic: str, frame: str, child: str, time_s: float, pose: ArrayLike) -> None:
        """Write where a robot is in a frame by its odometry: x, y, theta [m, rad]."""
        message = _header(frame, time_s).text(child)
        _put_pose(message, pose).numbers("d", *_NOTHING)
        message.numbers("d", *[0.0] * 6).numbers("d", *_NOTHING)
        self._write(topic, schemas.ODOMETRY, time_s, message)

    def transform(
        self,
        frame: str,
        child: str,
        time_s: float,
        pose: ArrayLike,
        *,
        height: float = 0.0,
        is_static: bool = False,
    ) -> None:
        """Write where a frame is in another one: x, y, theta [m, rad], and its height [m]."""
        message = _put_header(Cdr().numbers("I", 1), frame, time_s).text(child)
        topic = _LATCHED if is_static else "/tf"
        self._write(topic, schemas.TRANSFORMS, time_s, _put_pose(message, pose, height))

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
        message = _put_time(_header(frame, time_s), time_s)
        message.numbers("f", resolution).numbers("I", columns, rows)
        _put_pose(message, [*np.asarray(origin, np.float64), 0.0]).array(_GRID_LEVELS[levels])
        self._write(topic, schemas.GRID, time_s, message)

    def path(
        self, topic: str, frame: str, time_s: float, times: Sequence[float], poses: NDArray[np.float64]
    ) -> None:
        """Write a path: poses (n, 3) with their times (n,) [m, rad, s]."""
        message = _header(frame, time_s).numbers("I", len(poses))
        for when, pose in zip(times, poses, strict=True):
            _put_pose(_put_header(message, frame, when), pose)
        self._write(topic, schemas.PATH, time_s, message)

    def _write(self, topic: str, name: str, time_s: float, message: Cdr) -> None:
        if name not in self._schemas:
            self._schemas[name] = self._writer.register_schema(
                name, "ros2msg", schemas.definition(name).encode()
            )
        if topic not in self._channels:
            self._channels[topic] = self._writer.register_channel(topic, "cdr", self._schemas[name])
        stamp = round(time_s * NANO)
        self._writer.add_message(self._channels[topic], stamp, bytes(message), stamp)


@contextmanager
def bag(path: Path) -> Iterator[BagWriter]:
    """Lend a writer of a bag, which is there whole or not at all.

    Raises
    ------
    ValueError, OSError
        Where bags cannot be written; where nothing can be written there.
    """
    content = io.BytesIO()
    writer = BagWriter(content)
    yield writer
    writer.finish()
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_whole(path, content.getvalue())


def write_mcap_log(path: Path, log: LaserLog, robot: str = "robot") -> None:
    """Write a log of scans and odometry as a bag, whole or not at all.

    Stamps are rounded to a nanosecond, angles of beams to single precision: a bag has no more.

    Parameters
    ----------
    path : Path
        The file, by custom an ``.mcap``.
    log : LaserLog
        What `read_npz_log` and its like return.
    robot : str
        First part of the names of topics and frames.
    """
    frames = {name: f"{robot}/{name}" for name in ("odom", "base_link", "laser")}
    # Times of a bag begin at zero: messages of ROS have none before.
    times = log.stamps - min(float(log.stamps[0]), 0.0)
    readings = (log.readings_stamps - min(float(log.stamps[0]), 0.0), log.readings)
    if not len(log.readings_stamps) and log.odometry is not None:
        readings = times, log.odometry
    with bag(path) as writer:
        writer.transform(
            frames["base_link"], frames["laser"], float(times[0]), log.laser_pose, is_static=True
        )
        for time_s, pose in zip(*readings, strict=True):
            if np.isfinite(pose).all() and time_s >= 0.0:
                writer.odometry(f"/{robot}/odom", frames["odom"], frames["base_link"], float(time_s), pose)
                writer.transform(frames["odom"], frames["base_link"], float(time_s), pose)
        for time_s, ranges in zip(times, log.ranges, strict=True):
            writer.scan(
                f"/{robot}/scan", frames["laser"], float(time_s), ranges, log.geometry, log.beam_interval_s
            )


def _header(frame: str, time_s: float) -> Cdr:
    return _put_header(Cdr(), frame, time_s)


def _put_header(message: Cdr, frame: str, time_s: float) -> Cdr:
    return _put_time(message, time_s).text(frame)


def _put_time(message: Cdr, time_s: float) -> Cdr:
    seconds, nanoseconds = divmod(max(round(time_s * NANO), 0), NANO)
    return message.numbers("i", seconds).numbers("I", nanoseconds)


def _put_pose(message: Cdr, pose: ArrayLike, height: float = 0.0) -> Cdr:
    """Put a position, and a rotation about the vertical as a quaternion x, y, z, w."""
    x, y, theta = (float(value) for value in np.asarray(pose, np.float64))
    return message.numbers("d", x, y, height, 0.0, 0.0, math.sin(0.5 * theta), math.cos(0.5 * theta))
