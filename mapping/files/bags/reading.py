"""Reads the scans of bags of ROS, with their odometry, as a log."""

import math
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import partial
from itertools import takewhile
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
    topic : str
        Their topic.
    odometry, moving : dict
        Odometry by topic; by parent and child frame, that of the transforms from a frame that ends with ``odom``.
    frames : Frames
        Where frames are on each other.
    """

    topic: str
    scans: list[Any] = field(default_factory=list)
    odometry: dict[str, "_Odometry"] = field(default_factory=dict)
    moving: dict[tuple[str, str], "_Odometry"] = field(default_factory=dict)
    frames: Frames = field(default_factory=Frames)


@dataclass(slots=True)
class _Odometry:
    """Poses x, y, theta [m, rad] of a frame with their stamps [s]; the frame is empty if nothing names it."""

    base: str
    readings: list[tuple[float, tuple[float, float, float]]] = field(default_factory=list)

    def arrays(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the stamps, ascending, and the poses (n, 3)."""
        readings = sorted(self.readings, key=lambda reading: reading[0])
        poses = np.array([pose for _, pose in readings], np.float64).reshape(-1, 3)
        poses[:, 2] = np.unwrap(poses[:, 2])
        return np.array([stamp for stamp, _ in readings]), poses


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

    with open_storages(path) as storages:
        types = {name: kind for storage in storages for name, kind in storage.types.items()}
        scans = _chosen(path, [name for name, kind in types.items() if kind == LASER_SCAN], topic)
        found = _Messages(scans)
        odometry = [name for name, kind in types.items() if kind == ODOMETRY]
        transforms = [name for name, kind in types.items() if kind == TRANSFORMS]
        moving, static = (
            _most_alike(scans, [name for name in transforms if name.endswith(end)]) for end in ("/tf", "/tf_static")
        )
        wanted = [name for name in (scans, *odometry, moving, static) if name is not None]
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
        elif name in odometry:
            pose = content.pose.pose
            own = found.odometry.setdefault(name, _Odometry(frame_of(content.child_frame_id)))
            own.readings.append((seconds_of(content.header.stamp), in_plane(pose.position, pose.orientation)))
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
    in_order = sorted(topics, key=lambda name: (not name.endswith("odom"), name.count("/"), name))
    return max(in_order, key=partial(_shared, scans), default=None)


def _shared(scans: str, name: str) -> int:
    """Return how many parts at the beginning of two names are the same."""
    both = zip(scans.split("/"), name.split("/"), strict=False)
    return sum(1 for _ in takewhile(lambda parts: parts[0] == parts[1], both))


def _note_transforms(found: _Messages, content: Any, *, is_static: bool) -> None:  # noqa: ANN401
    for each in content.transforms:
        parent, child = frame_of(each.header.frame_id), frame_of(each.child_frame_id)
        if parent.rstrip("/").endswith("odom") and not is_static:
            pose = in_plane(each.transform.translation, each.transform.rotation)
            own = found.moving.setdefault((parent, child), _Odometry(child))
            own.readings.append((seconds_of(each.header.stamp), pose))
        found.frames.note(parent, child, each.transform, is_static=is_static)


def _log(path: Path, messages: _Messages) -> LaserLog:
    skipped, remarks = dict[str, int](), list[str]()
    frames_of_scans = Counter(frame_of(scan.header.frame_id) for scan in messages.scans)
    laser = next((frame for frame, _ in frames_of_scans.most_common(1)), "")
    of_laser = [scan for scan in messages.scans if frame_of(scan.header.frame_id) == laser]
    for frame, count in frames_of_scans.items():
        if frame != laser:
            skipped[f"scans in the frame {printable(frame)}, not {printable(laser)} as most"] = count
    odometry = _odometry(messages, laser, remarks)
    readings_stamps, readings = odometry.arrays()
    laser_pose, is_hanging = _mounted(messages, odometry.base, laser, remarks)
    kept, ranges, beams = list[Any](), list[NDArray[np.float32]](), list[Beams]()
    for scan in of_laser:
        directions = directions_of(scan, is_hanging=is_hanging)
        if directions is not None:
            kept.append(scan)
            own, directions = from_right_to_left(np.array(scan.ranges, np.float32), directions)
            ranges.append(own)
            beams.append(directions)
    if len(kept) < len(of_laser):
        skipped["scans without beams, or whose header has no directions"] = len(of_laser) - len(kept)
    if not kept:
        raise ValueError(f"{path} holds no scans; want messages of {LASER_SCAN}")
    check_metres(np.concatenate(ranges), str(path))
    least, most = min(float(scan.range_min) for scan in kept), _reach(kept, ranges, remarks)
    scans = [marked(own, float(scan.range_min), high) for own, scan, high in zip(ranges, kept, most, strict=True)]
    table, directions, others = on_one_grid(scans, beams)
    if others:
        remarks.append(f"{others} x scans whose beams are not as those of most are resampled")
    sweep = symmetric_scans(table, *directions[:2], (max(least, 0.0), max(most)))
    is_reversed = (float(kept[0].angle_increment) < 0.0) != is_hanging
    is_in_time = not (others or is_reversed or sweep.is_rolled)
    interval = np.array([max(float(scan.time_increment), 0.0) for scan in kept])
    last = np.array([len(own) - 1 for own in ranges]) + (sweep.behind if is_in_time else 0)
    stamps = np.array([seconds_of(scan.header.stamp) for scan in kept]) + interval * last
    has_readings = len(readings_stamps) > 0
    return LaserLog(
        stamps=stamps,
        ranges=sweep.ranges,
        geometry=sweep.geometry,
        odometry=odometry_at(readings_stamps, readings, stamps) if has_readings else None,
        laser_pose=laser_pose + np.array([0.0, 0.0, sweep.axis]),
        beam_interval_s=float(np.median(interval)),
        is_in_time=is_in_time,
        readings_stamps=readings_stamps,
        readings=readings,
        reading_of_scan=(
            np.searchsorted(readings_stamps, stamps, side="right") - 1 if has_readings else np.zeros(0, np.int64)
        ),
        skipped=skipped,
        remarks=tuple(remarks),
    )


def _mounted(messages: _Messages, body: str, laser: str, remarks: list[str]) -> Mounting:
    """Return where the laser is on the robot; without odometry the body is the frame to which the laser is fixed."""
    base = body or messages.frames.body(laser)
    found = messages.frames.mounting(base, laser)
    if found is None or (base == laser and not body):
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


def _odometry(messages: _Messages, laser: str, remarks: list[str]) -> _Odometry:
    """Return the odometry of the robot that has the laser: of a topic, or else of the transforms.

    It is that of a body to which transforms lead from the laser, if there is one, and whose topic's name (or frame)
    begins most like that of the scans (or laser).
    """
    like, sources = messages.topic, messages.odometry
    if not sources:
        like, sources = laser, {child: odometry for (_, child), odometry in reversed(messages.moving.items())}
    near = {name: each for name, each in sources.items() if messages.frames.is_connected(each.base, laser)} or sources
    chosen = _most_alike(like, near)
    if chosen is None:
        return _Odometry("")
    others = [name for name in near if name != chosen and _shared(like, name) == _shared(like, chosen)]
    if others:
        remarks.append(f"odometry is that of {printable(chosen)}, not of {', '.join(map(printable, others))}")
    return near[chosen]


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
