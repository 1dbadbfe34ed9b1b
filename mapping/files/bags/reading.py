"""Reads the scans of bags of ROS 2, with their odometry, as a log."""

import math
import os
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.files.bags import schemas
from lidarium.mapping.files.guarded_reading import most_unpacked, open_guarded, reading
from lidarium.mapping.files.laser_logs import LaserLog, made_usable, symmetric_scans
from lidarium.mapping.files.names import printable
from lidarium.mapping.files.trajectories import interpolated

_WANTED = "want a whole MCAP file of ROS 2 messages (ros2msg, CDR)"
_RECORD_BYTES = 1 << 28
_LEAST_BYTES = 64
"""A bag has its magic bytes twice, a header and a footer."""

_MAP_RATIO = 2
"""Chunks hold maps, too, which pack better than what is read of them."""

_TF, _STATIC = "/tf", "/tf_static"


@dataclass(slots=True)
class Messages:
    """What of a bag makes a log.

    Attributes
    ----------
    scans : list
        Messages of the chosen topic.
    odometry_stamps, odometry : list
        When odometry was read [s], and what it was: x, y, theta [m, rad].
    base : str
        Frame of the robot's body as the odometry names it.
    static : dict
        Where frames are fixed on others: x, y, theta by parent and child [m, rad].
    moving : dict
        Stamps and poses of frames that move on others, by parent and child.
    """

    scans: list[Any] = field(default_factory=list)
    odometry_stamps: list[float] = field(default_factory=list)
    odometry: list[tuple[float, float, float]] = field(default_factory=list)
    base: str = ""
    static: dict[tuple[str, str], tuple[float, float, float]] = field(default_factory=dict)
    moving: dict[tuple[str, str], list[tuple[float, tuple[float, float, float]]]] = field(
        default_factory=dict
    )


def read_mcap_log(path: Path, topic: str | None = None) -> LaserLog:
    """Read a log from the scans of a bag.

    Parameters
    ----------
    path : Path
        An MCAP file with messages of ROS 2 (ros2msg, CDR).
    topic : str or None
        The topic of the scans, where there are several.

    Returns
    -------
    LaserLog
        Odometry is that of the topic whose name is most like that of the scans; without one it is the
        transform from a frame that ends with ``odom``. The laser's place on the robot is taken from
        ``/tf_static``.

    Raises
    ------
    FileNotFoundError
        Where there is no such file.
    ValueError
        Where it is no whole bag, has no scans or several topics of them, or the extra ``mcap`` is not
        installed.
    """
    path = Path(path)
    try:
        from mcap.exceptions import DecoderNotFoundError, McapError

        # What the parser of message definitions raises has no public name.
        from mcap_ros2._vendor.rosidl_adapter.parser import InvalidSpecification, InvalidValue
        from zstandard import ZstdError
    except ImportError as error:
        raise ValueError('bags need mcap-ros2-support; pip install "lidarium[mcap]"') from error
    with reading(path, "a whole bag", _WANTED):
        try:
            messages = _messages(path, topic)
        except DecoderNotFoundError as error:
            raise ValueError(f"{path} has messages of another kind ({error}); {_WANTED}") from error
        except (McapError, ZstdError, InvalidSpecification, InvalidValue, NameError) as error:
            raise ValueError(
                f"{path} is not a whole bag, it is cut off or damaged ({error}); {_WANTED}"
            ) from error
    with reading(path, "a log"):
        return made_usable(_log(path, messages), str(path))


def _messages(path: Path, topic: str | None) -> Messages:
    from mcap.reader import SeekingReader

    found = Messages()
    with open_guarded(path) as file:
        if file.seek(0, os.SEEK_END) < _LEAST_BYTES:
            raise ValueError(f"{path} is not a whole bag, it is cut off; {_WANTED}")
        file.seek(0)
        reader = SeekingReader(file, validate_crcs=True, record_size_limit=_RECORD_BYTES)
        summary = reader.get_summary()
        if summary is None:
            raise ValueError(f"{path} has no index at its end, it is cut off; {_WANTED}")
        allowed = most_unpacked(os.fstat(file.fileno()).st_size)
        _check_chunks(path, file, summary, _MAP_RATIO * allowed)
        topics: dict[str, set[str]] = {}
        for channel in summary.channels.values():
            schema = summary.schemas.get(channel.schema_id)
            topics.setdefault("" if schema is None else schema.name, set()).add(channel.topic)
        scans = _chosen(path, topics.get(schemas.LASER_SCAN, set()), topic)
        odometry = _most_alike(scans, topics.get(schemas.ODOMETRY, set()))
        wanted = [name for name in (scans, odometry, _TF, _STATIC) if name is not None]
        for name, content in _decoded(path, reader, wanted, allowed):
            if name == scans:
                found.scans.append(content)
            elif name == odometry:
                found.odometry_stamps.append(_seconds(content.header.stamp))
                pose = content.pose.pose
                found.odometry.append(_in_plane(pose.position, pose.orientation))
                found.base = content.child_frame_id
            else:
                _note_transforms(found, content, is_static=name == _STATIC)
    return found


def _decoded(path: Path, reader: Any, wanted: list[str], allowed: int) -> Iterator[tuple[str, Any]]:  # noqa: ANN401
    """Yield topic and content of messages in the order in which they were logged."""
    from mcap.exceptions import DecoderNotFoundError
    from mcap_ros2.decoder import DecoderFactory

    # Sorted here: the reader's own queue takes half as long as decoding.
    messages = []
    for each in reader.iter_messages(wanted, log_time_order=False):
        allowed -= len(each[2].data)
        if allowed < 0:
            raise ValueError(f"{path} packs its scans too well; want a bag of a robot")
        messages.append(each)
    messages.sort(key=lambda each: each[2].log_time)
    factory, decoders = DecoderFactory(), {}
    for schema, channel, message in messages:
        if channel.id not in decoders:
            decoders[channel.id] = factory.decoder_for(channel.message_encoding, schema)
        decode = decoders[channel.id]
        if decode is None:
            raise DecoderNotFoundError(f"{channel.message_encoding}, {schema and schema.name}")
        yield channel.topic, decode(message.data)


def _check_chunks(path: Path, file: BinaryIO, summary: Any, allowed: int) -> None:  # noqa: ANN401
    """Raise ValueError where chunks have too many bytes when unpacked, or another number than they say."""
    import zstandard
    from mcap.data_stream import ReadDataStream
    from mcap.records import Chunk

    unpacked = 0
    for index in summary.chunk_indexes:
        file.seek(index.chunk_start_offset + 9)  # behind the record's kind and length
        chunk = Chunk.read(ReadDataStream(file))
        size = chunk.uncompressed_size
        if chunk.compression == "zstd" and zstandard.frame_content_size(chunk.data) not in (-1, size):
            raise ValueError(f"{path} has a chunk of another size than it says; {_WANTED}")
        unpacked += size
        if unpacked > allowed:
            raise ValueError(f"{path} has more than {allowed:,} bytes when unpacked; want fewer")
    file.seek(0)


def _chosen(path: Path, topics: Iterable[str], topic: str | None) -> str:
    """Return the topic of the scans."""
    names = sorted(topics)
    listed = ", ".join(map(printable, names))
    if not names:
        raise ValueError(f"{path} holds no scans; want a topic of {schemas.LASER_SCAN}")
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


def _note_transforms(found: Messages, content: Any, *, is_static: bool) -> None:  # noqa: ANN401
    for each in content.transforms:
        frames = each.header.frame_id, each.child_frame_id
        pose = _in_plane(each.transform.translation, each.transform.rotation)
        if is_static:
            found.static[frames] = pose
        else:
            found.moving.setdefault(frames, []).append((_seconds(each.header.stamp), pose))


def _log(path: Path, messages: Messages) -> LaserLog:
    scans, skipped = messages.scans, dict[str, int]()
    if not scans:
        raise ValueError(f"{path} holds no scans; want messages of {schemas.LASER_SCAN}")
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
    laser = messages.static.get((messages.base, first.header.frame_id), (0.0, 0.0, 0.0))
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
            np.searchsorted(readings_stamps, stamps, side="right") - 1
            if has_readings
            else np.zeros(0, np.int64)
        ),
        skipped=skipped,
    )


def _odometry(messages: Messages) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return when odometry was read, ascending, and what it was (n, 3)."""
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


def _seconds(stamp: Any) -> float:  # noqa: ANN401
    return float(stamp.sec) + 1e-9 * float(stamp.nanosec)


def _in_plane(place: Any, turn: Any) -> tuple[float, float, float]:  # noqa: ANN401
    """Return x, y, theta of a pose in space [m, rad]."""
    theta = math.atan2(
        2.0 * (turn.w * turn.z + turn.x * turn.y), 1.0 - 2.0 * (turn.y * turn.y + turn.z * turn.z)
    )
    return float(place.x), float(place.y), theta
