"""Reads the scans of bags of ROS, with their odometry, as a log."""

import math
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.files.bags.messages import BAG_SUFFIXES, LASER_SCAN, ODOMETRY, decoder
from lidarium.mapping.files.guarded_reading import printable, reading, reason
from lidarium.mapping.files.laser_logs import LaserLog, made_usable, symmetric_scans
from lidarium.mapping.files.trajectories import interpolated

_TF, _STATIC = "/tf", "/tf_static"


@dataclass(slots=True)
class _Messages:
    """The messages of a bag that make a log.

    Attributes
    ----------
    scans : list
        Messages of the chosen topic.
    odometry_stamps, odometry : list
        Stamps of the odometry [s], and its poses x, y, theta [m, rad].
    base : str
        Frame of the robot's body as the odometry names it.
    static : dict
        Poses of frames fixed on others: x, y, theta by parent and child [m, rad].
    moving : dict
        Stamps and poses of frames that move on others, by parent and child.
    """

    scans: list[Any] = field(default_factory=list)
    odometry_stamps: list[float] = field(default_factory=list)
    odometry: list[tuple[float, float, float]] = field(default_factory=list)
    base: str = ""
    static: dict[tuple[str, str], tuple[float, float, float]] = field(default_factory=dict)
    moving: dict[tuple[str, str], list[tuple[float, tuple[float, float, float]]]] = field(default_factory=dict)


def is_bag(path: Path) -> bool:
    """Whether a path is a bag by its name: a folder, or a file with the ending of one."""
    return path.is_dir() or path.name.endswith(BAG_SUFFIXES)


def read_bag_log(path: Path, topic: str | None = None) -> LaserLog:
    """Read a log from the scans of a bag of ROS 1 or 2.

    Odometry is read from the topic whose name begins most like that of the scans, else from the transforms from a
    frame that ends with ``odom``. The laser's pose on the robot is read from ``/tf_static``.
    """
    path = Path(path)
    try:
        from lidarium.mapping.files.bags.storages import STORAGE_ERRORS, WANTED
    except ImportError as error:
        raise ValueError(f'bags need the package {error.name}; pip install "lidarium[bags]"') from error
    with reading(path, "a whole bag", WANTED):
        try:
            messages = _messages(path, topic)
        except STORAGE_ERRORS as error:
            raise ValueError(
                f"{path} is not a whole bag, it is cut off or damaged ({reason(error)}); {WANTED}"
            ) from error
    with reading(path, "a log"):
        return made_usable(_log(path, messages), str(path))


def _messages(path: Path, topic: str | None) -> _Messages:
    from lidarium.mapping.files.bags.storages import open_storages

    found = _Messages()
    with open_storages(path) as storages:
        types = {name: kind for storage in storages for name, kind in storage.types.items()}
        scans = _chosen(path, [name for name, kind in types.items() if kind == LASER_SCAN], topic)
        odometry = _most_alike(scans, [name for name, kind in types.items() if kind == ODOMETRY])
        wanted = [name for name in (scans, odometry, _TF, _STATIC) if name in types]
        messages = [
            (time, name, content, decoder(storage.is_ros1))
            for storage in storages
            for time, name, content in storage.messages(wanted)
        ]
    messages.sort(key=lambda each: each[0])
    for _, name, raw, decode in messages:
        content = decode(raw, types[name])
        if name == scans:
            found.scans.append(content)
        elif name == odometry:
            found.odometry_stamps.append(_seconds(content.header.stamp))
            pose = content.pose.pose
            found.odometry.append(_in_plane(pose.position, pose.orientation))
            found.base = _frame(content.child_frame_id)
        else:
            _note_transforms(found, content, is_static=name == _STATIC)
    return found


def _chosen(path: Path, topics: Iterable[str], topic: str | None) -> str:
    """Return the topic of the scans."""
    names = sorted(topics)
    listed = ", ".join(map(printable, names))
    if not names:
        raise ValueError(f"{path} holds no scans; want a topic of {LASER_SCAN}")
    if topic is not None and topic not in names:
        raise ValueError(f"{path} has no scans on topic {topic!r}; want one of {listed}")
    if topic is None and len(names) > 1:
        raise ValueError(f"{path} has scans on {len(names)} topics; choose one by --topic: {listed}")
    return names[0] if topic is None else topic


def _most_alike(scans: str, topics: Iterable[str]) -> str | None:
    """Return the topic that shares the most of its name's beginning with that of the scans."""

    def shared(name: str) -> int:
        return sum(1 for _ in _same_beginning(scans.split("/"), name.split("/")))

    return max(sorted(topics, key=lambda name: (not name.endswith("odom"), name)), key=shared, default=None)


def _same_beginning(a: Iterable[str], b: Iterable[str]) -> Iterator[str]:
    for left, right in zip(a, b, strict=False):
        if left != right:
            return
        yield left


def _note_transforms(found: _Messages, content: Any, *, is_static: bool) -> None:  # noqa: ANN401
    for each in content.transforms:
        frames = _frame(each.header.frame_id), _frame(each.child_frame_id)
        pose = _in_plane(each.transform.translation, each.transform.rotation)
        if is_static:
            found.static[frames] = pose
        else:
            found.moving.setdefault(frames, []).append((_seconds(each.header.stamp), pose))


def _log(path: Path, messages: _Messages) -> LaserLog:
    scans, skipped = messages.scans, dict[str, int]()
    if not scans:
        raise ValueError(f"{path} holds no scans; want messages of {LASER_SCAN}")
    lengths = Counter(len(scan.ranges) for scan in scans)
    beams = lengths.most_common(1)[0][0]
    alike = [scan for scan in scans if len(scan.ranges) == beams]
    if len(alike) < len(scans):
        skipped["scans of another length than most"] = len(scans) - len(alike)
    first = alike[0]
    ranges = np.array([scan.ranges for scan in alike], np.float32).reshape(len(alike), beams)
    with np.errstate(invalid="ignore"):
        ranges[ranges > np.float32(first.range_max)] = np.inf
        ranges[ranges < np.float32(first.range_min)] = np.nan
    angle_min, increment = float(first.angle_min), float(first.angle_increment)
    if increment < 0.0:
        ranges, angle_min, increment = (
            np.ascontiguousarray(ranges[:, ::-1]),
            angle_min + (beams - 1) * increment,
            -increment,
        )
    interval = max(float(first.time_increment), 0.0)
    stamps = np.array([_seconds(scan.header.stamp) + interval * (beams - 1) for scan in alike])
    wide, geometry, axis = symmetric_scans(
        ranges, angle_min, increment, (float(first.range_min), float(first.range_max))
    )
    readings_stamps, readings = _odometry(messages)
    laser = messages.static.get((messages.base, _frame(first.header.frame_id)), (0.0, 0.0, 0.0))
    has_readings = len(readings_stamps) > 0
    return LaserLog(
        stamps=stamps,
        ranges=wide,
        geometry=geometry,
        odometry=interpolated(readings_stamps, readings, stamps) if has_readings else None,
        laser_pose=np.array(laser) + np.array([0.0, 0.0, axis]),
        beam_interval_s=interval,
        readings_stamps=readings_stamps,
        readings=readings,
        reading_of_scan=(
            np.searchsorted(readings_stamps, stamps, side="right") - 1 if has_readings else np.zeros(0, np.int64)
        ),
        skipped=skipped,
    )


def _odometry(messages: _Messages) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the stamps of the odometry, ascending, and its poses (n, 3)."""
    stamps, poses = messages.odometry_stamps, messages.odometry
    if not stamps:
        for (parent, child), moves in messages.moving.items():
            if parent.rstrip("/").endswith("odom"):
                stamps, poses = [when for when, _ in moves], [pose for _, pose in moves]
                messages.base = child
                break
    if not stamps:
        return np.zeros(0), np.zeros((0, 3))
    times, table = np.array(stamps), np.array(poses)
    order = np.argsort(times, kind="stable")
    table = table[order]
    table[:, 2] = np.unwrap(table[:, 2])
    return times[order], table


def _frame(name: str) -> str:
    """Return the name of a frame; ROS 1 allows a slash before it."""
    return name.removeprefix("/")


def _seconds(stamp: Any) -> float:  # noqa: ANN401
    return float(stamp.sec) + 1e-9 * float(stamp.nanosec)


def _in_plane(place: Any, turn: Any) -> tuple[float, float, float]:  # noqa: ANN401
    """Return x, y, theta of a pose in space [m, rad]."""
    theta = math.atan2(2.0 * (turn.w * turn.z + turn.x * turn.y), 1.0 - 2.0 * (turn.y * turn.y + turn.z * turn.z))
    return float(place.x), float(place.y), theta
