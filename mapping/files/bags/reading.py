"""Reads the scans of bags of ROS, with their odometry, as a log."""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.extras import install_command
from lidarium.mapping.files.bags.frames import Frames, Mounting
from lidarium.mapping.files.bags.messages import BAG_SUFFIXES, LASER_SCAN, ODOMETRY, TRANSFORMS, decoder
from lidarium.mapping.files.beams import (
    WHOLE_TURN,
    Beams,
    check_metres,
    from_right_to_left,
    marked,
    on_one_grid,
    symmetric_scans,
)
from lidarium.mapping.files.guarded_reading import printable, reading, reason
from lidarium.mapping.files.laser_logs import LaserLog, made_usable
from lidarium.mapping.files.odometry_faults import odometry_at


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
        Frame of the robot's body as the odometry names it; empty if there is none.
    frames : Frames
        Where frames are on each other.
    moving : dict
        Stamps and poses of frames in a frame that ends with ``odom``, by parent and child.
    """

    scans: list[Any] = field(default_factory=list)
    odometry_stamps: list[float] = field(default_factory=list)
    odometry: list[tuple[float, float, float]] = field(default_factory=list)
    base: str = ""
    frames: Frames = field(default_factory=Frames)
    moving: dict[tuple[str, str], list[tuple[float, tuple[float, float, float]]]] = field(default_factory=dict)


def is_bag(path: Path) -> bool:
    """Whether a path is a bag by its name: a folder, or a file with the ending of one."""
    return path.is_dir() or path.name.endswith(BAG_SUFFIXES)


def read_bag_log(path: Path, topic: str | None = None) -> LaserLog:
    """Read a log from the scans of a bag of ROS 1 or 2.

    Odometry is read from the topic whose name begins most like that of the scans, else from the transforms from a
    frame that ends with ``odom``. The laser's pose on the robot is that of a chain of transforms.
    """
    path = Path(path)
    try:
        from lidarium.mapping.files.bags.storages import STORAGE_ERRORS, WANTED
    except ImportError as error:
        raise ValueError(f"bags need the package {error.name}: {install_command('bags')}") from error
    with reading(path, "a whole bag", WANTED):
        try:
            messages = _messages(path, topic)
        except (*STORAGE_ERRORS, OSError) as error:
            # A bare one without a file's name is of a library: bz2 on damaged data, or a seek to before the beginning.
            if isinstance(error, OSError) and (type(error) is not OSError or error.filename is not None):
                raise
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
        transforms = [name for name, kind in types.items() if kind == TRANSFORMS]
        moving, static = (
            _most_alike(scans, [name for name in transforms if name.endswith(end)]) for end in ("/tf", "/tf_static")
        )
        wanted = [name for name in (scans, odometry, moving, static) if name is not None]
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
            found.odometry_stamps.append(seconds_of(content.header.stamp))
            pose = content.pose.pose
            found.odometry.append(in_plane(pose.position, pose.orientation))
            found.base = frame_of(content.child_frame_id)
        else:
            _note_transforms(found, content, is_static=name == static)
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
        parent, child = frame_of(each.header.frame_id), frame_of(each.child_frame_id)
        if parent.rstrip("/").endswith("odom") and not is_static:
            pose = in_plane(each.transform.translation, each.transform.rotation)
            found.moving.setdefault((parent, child), []).append((seconds_of(each.header.stamp), pose))
        found.frames.note(parent, child, each.transform, is_static=is_static)


def _log(path: Path, messages: _Messages) -> LaserLog:
    skipped, remarks = dict[str, int](), list[str]()
    readings_stamps, readings = _odometry(messages)
    laser_pose, is_hanging = _mounted(messages, remarks)
    kept, ranges, beams = list[Any](), list[NDArray[np.float32]](), list[Beams]()
    for scan in messages.scans:
        directions = directions_of(scan, is_hanging=is_hanging)
        if directions is not None:
            kept.append(scan)
            own, directions = from_right_to_left(np.array(scan.ranges, np.float32), directions)
            ranges.append(own)
            beams.append(directions)
    if len(kept) < len(messages.scans):
        skipped["scans without beams, or whose header has no directions"] = len(messages.scans) - len(kept)
    if not kept:
        raise ValueError(f"{path} holds no scans; want messages of {LASER_SCAN}")
    check_metres(np.concatenate(ranges), str(path))
    least, most = min(float(scan.range_min) for scan in kept), _reach(kept, ranges, remarks)
    scans = [marked(own, float(scan.range_min), high) for own, scan, high in zip(ranges, kept, most, strict=True)]
    table, directions, others = on_one_grid(scans, beams)
    if others:
        remarks.append(f"{others} x scans whose beams are not as those of most are resampled")
    wide, geometry, axis = symmetric_scans(table, *directions[:2], (max(least, 0.0), max(most)))
    interval = np.array([max(float(scan.time_increment), 0.0) for scan in kept])
    stamps = np.array([seconds_of(scan.header.stamp) for scan in kept]) + interval * [len(own) - 1 for own in ranges]
    is_turned = abs(geometry.angle_first + axis - directions.angle_min) > 0.5 * directions.increment
    is_reversed = (float(kept[0].angle_increment) < 0.0) != is_hanging
    if interval.any() and (others or is_reversed or (is_turned and geometry.is_full_circle)):
        remarks.append("motion within scans is not undone: their beams are not in the order of time from behind")
        interval[:] = 0.0
    has_readings = len(readings_stamps) > 0
    return LaserLog(
        stamps=stamps,
        ranges=wide,
        geometry=geometry,
        odometry=odometry_at(readings_stamps, readings, stamps) if has_readings else None,
        laser_pose=laser_pose + np.array([0.0, 0.0, axis]),
        beam_interval_s=float(interval[0]),
        readings_stamps=readings_stamps,
        readings=readings,
        reading_of_scan=(
            np.searchsorted(readings_stamps, stamps, side="right") - 1 if has_readings else np.zeros(0, np.int64)
        ),
        skipped=skipped,
        remarks=tuple(remarks),
    )


def _mounted(messages: _Messages, remarks: list[str]) -> Mounting:
    """Return where the laser is on the robot; without odometry the body is the frame to which the laser is fixed."""
    if not messages.scans:
        return Mounting(np.zeros(3), is_hanging=False)
    laser = frame_of(messages.scans[0].header.frame_id)
    base = messages.base or messages.frames.body(laser)
    found = messages.frames.mounting(base, laser)
    if found is None or (base == laser and not messages.base):
        remarks.append(
            f"no transforms say where the laser ({printable(laser)}) is on the robot ({printable(base)}): it is taken "
            "as upright, in the robot's middle, looking ahead"
        )
        return Mounting(np.zeros(3), is_hanging=False)
    if found.is_hanging:
        remarks.append("the laser hangs upside down: the beams of its scans are reversed")
    return found


def directions_of(scan: Any, *, is_hanging: bool) -> Beams | None:  # noqa: ANN401
    """Return the directions that a scan's header states; None if it states none.

    Steps are those between the first and the last direction if the header has no usable step.
    """
    count, first, step = len(scan.ranges), float(scan.angle_min), float(scan.angle_increment)
    if count and not 0.0 < abs(step) * (count - 1.5) < WHOLE_TURN:
        step = (float(scan.angle_max) - first) / max(count - 1, 1)
    if not (count and math.isfinite(first) and 0.0 < abs(step) < math.inf):
        return None
    return Beams(-first, -step) if is_hanging else Beams(first, step)


def _reach(scans: list[Any], ranges: list[NDArray[np.float32]], remarks: list[str]) -> list[float]:
    """Return the range of each scan that means no return [m]; if a header states none, more than any range."""
    stated = [float(scan.range_max) for scan in scans]
    if all(0.0 < value < math.inf for value in stated):
        return stated
    known = np.concatenate(ranges)
    highest = float(known[np.isfinite(known)].max(initial=1.0))
    remarks.append("headers of scans state no longest range: only infinity is taken for no return")
    return [value if 0.0 < value < math.inf else 1.01 * highest for value in stated]


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


def frame_of(name: str) -> str:
    """Return the name of a frame; ROS 1 allows a slash before it."""
    return name.removeprefix("/")


def seconds_of(stamp: Any) -> float:  # noqa: ANN401
    """Return a stamp in seconds."""
    return float(stamp.sec) + 1e-9 * float(stamp.nanosec)


def in_plane(place: Any, turn: Any) -> tuple[float, float, float]:  # noqa: ANN401
    """Return x, y, theta of a pose in space [m, rad]."""
    theta = math.atan2(2.0 * (turn.w * turn.z + turn.x * turn.y), 1.0 - 2.0 * (turn.y * turn.y + turn.z * turn.z))
    return float(place.x), float(place.y), theta
