"""Records as files: a zip of a header, events and compressed arrays.

``numpy.load`` opens it as well.
"""

import io
import json
import math
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.evaluation.record.episode_record import (
    TIME,
    CrowdTrack,
    DisplayTrack,
    EpisodeRecord,
    MapChanges,
    NewerFormatError,
    check_header,
)
from lidarium.mapping.files.guarded_reading import GuardedArchive, read_bytes, reading
from lidarium.mapping.files.output import whole_file

_HEADER, _EVENTS = "header.json", "events.json"
_ARRAYS = (
    "commands",
    "pose_steps",
    "poses",
    "coverage",
    "map_steps",
    "map_counts",
    "map_places",
    "map_known",
    "map_occupied",
)
_CROWD = ("crowd_steps", "people", "door_ends", "doors_opened")
"""Arrays of records with people or doors; others do not have them."""

_EPOCH = (1980, 1, 1, 0, 0, 0)
MOST_COMMAND = 1e6
"""Highest speed or turn rate that a record may command [m/s, rad/s]."""

_UNITS = 1e3
"""Steps of positions and headings in a metre and a radian."""


def write_record(path: Path, record: EpisodeRecord) -> None:
    """Write a record, whole or not at all.

    The same record gives the same file.
    """
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive:
        _add(archive, _HEADER, _json(record.header))
        _add(archive, _EVENTS, _json(record.display.events))
        for name, array in {**_packed(record), **_packed_crowd(record)}.items():
            with io.BytesIO() as member:
                np.lib.format.write_array(member, array, allow_pickle=False)
                _add(archive, f"{name}.npy", member.getvalue())
    with whole_file(path) as beside:
        beside.write_bytes(content.getvalue())


def read_record(path: Path) -> EpisodeRecord:
    """Read a record of this version or an older one."""
    path = Path(path)
    content = read_bytes(path)
    with reading(path, "a whole episode record", "want a file that lidarium run --record wrote"):
        archive = GuardedArchive(content)
        header = json.loads(archive.read(_HEADER))
        try:
            check_header(header)
        except NewerFormatError as error:
            raise ValueError(f"{path} {error}") from error
        events = json.loads(archive.read(_EVENTS))
        # Members are read as a whole first, which checks the checksum: nothing damaged is parsed.
        arrays = {name: archive.array(f"{name}.npy") for name in _ARRAYS}
        has_crowd = f"{_CROWD[0]}.npy" in archive.names
        crowd = {name: archive.array(f"{name}.npy") for name in _CROWD} if has_crowd else {}
        return _unpacked(header, events, arrays, crowd)


def _add(archive: zipfile.ZipFile, name: str, content: bytes) -> None:
    member = zipfile.ZipInfo(name, _EPOCH)
    member.compress_type = zipfile.ZIP_DEFLATED
    archive.writestr(member, content)


def _json(content: Any) -> bytes:  # noqa: ANN401
    try:
        return json.dumps(content, allow_nan=False, ensure_ascii=False).encode("utf-8", "surrogatepass")
    except TypeError as error:
        raise ValueError(f"an event or the header of the record holds what JSON cannot: {error}") from error


def _packed(record: EpisodeRecord) -> dict[str, NDArray[Any]]:
    """Return the arrays of a record unchanged from the file.

    Times are steps; poses and places are differences of whole numbers.
    """
    display, time_step = record.display, float(record.header["time_step"])
    changes, counted = display.changes, max(int(record.header["counted_cells"]), 1)
    poses = np.rint(display.poses * _UNITS).astype(np.int32)
    arrays: dict[str, NDArray[Any]] = {
        "commands": record.commands,
        "pose_steps": _steps(display.times, time_step),
        "poses": np.diff(poses, axis=0, prepend=np.int32(0)),
        "coverage": np.stack(
            [
                _steps(display.coverage[:, 0], time_step),
                np.rint(display.coverage[:, 1] * counted).astype(np.int32),
            ],
            axis=1,
        ),
        "map_steps": _steps(changes.times, time_step),
        "map_counts": changes.counts.astype(np.int32),
        "map_places": np.diff(changes.places.astype(np.int32), prepend=np.int32(0)),
        "map_known": changes.known,
        "map_occupied": changes.occupied,
    }
    return {name: np.ascontiguousarray(arrays[name], arrays[name].dtype.newbyteorder("<")) for name in _ARRAYS}


def _packed_crowd(record: EpisodeRecord) -> dict[str, NDArray[Any]]:
    """Return the arrays of people and doors, whole numbers as those of `_packed`; none without any."""
    crowd, time_step = record.display.crowd, float(record.header["time_step"])
    if crowd is None:
        return {}
    people = np.rint(crowd.people * _UNITS).astype("<i4")
    opened = np.rint(crowd.opened * 100.0).astype("<i4")
    arrays = (
        _steps(crowd.times, time_step).astype("<i4"),
        np.diff(people, axis=0, prepend=np.int32(0)),
        np.rint(crowd.doors * _UNITS).astype("<i4"),
        np.diff(opened, axis=0, prepend=np.int32(0)),
    )
    return {name: np.ascontiguousarray(array) for name, array in zip(_CROWD, arrays, strict=True)}


def _unpacked_crowd(arrays: dict[str, NDArray[Any]], time_step: float) -> CrowdTrack | None:
    if not arrays:
        return None
    steps, people, ends, opened = (arrays[name] for name in _CROWD)
    samples, doors = len(steps), len(ends)
    is_whole = all(array.dtype == np.int32 for array in arrays.values())
    if not is_whole or not samples or steps.ndim != 1 or people.ndim != 3:
        raise ValueError("its people and doors are not whole numbers of samples")
    shapes = (people.shape, ends.shape, opened.shape)
    if shapes != ((samples, people.shape[1], 3), (doors, 4), (samples, doors)):
        raise ValueError(f"its people and doors have shapes {shapes} for {samples} samples")
    return CrowdTrack(
        steps * time_step,
        np.cumsum(people, axis=0, dtype=np.int64) / _UNITS,
        ends / _UNITS,
        np.cumsum(opened, axis=0, dtype=np.int64) / 100.0,
    )


def _unpacked(
    header: dict[str, Any],
    events: Any,  # noqa: ANN401
    arrays: dict[str, NDArray[Any]],
    crowd: dict[str, NDArray[Any]],
) -> EpisodeRecord:
    """Make a record of the content of a file, checked."""
    steps, robots, time_step = header["steps"], header["robots"], header["time_step"]
    (rows, words), counted = header["map_shape"], max(header["counted_cells"], 1)
    poses, samples = len(arrays["pose_steps"]), len(arrays["map_counts"])
    changed = len(arrays["map_places"])
    shapes = {
        "commands": (steps, robots, 2),
        "pose_steps": (poses,),
        "poses": (poses, robots, 3),
        "coverage": (len(arrays["coverage"]), 2),
        "map_steps": (samples,),
        "map_counts": (samples,),
        "map_places": (changed,),
        "map_known": (changed,),
        "map_occupied": (changed,),
    }
    for name, shape in shapes.items():
        kind = {"commands": np.float64, "map_known": np.uint64, "map_occupied": np.uint64}.get(name, np.int32)
        if arrays[name].shape != shape or arrays[name].dtype != kind:
            raise ValueError(
                f"{name} has shape {arrays[name].shape} of {arrays[name].dtype}; want {shape} of {np.dtype(kind)}"
            )
    if not (np.abs(arrays["commands"]) <= MOST_COMMAND).all():
        raise ValueError(f"commands are not all numbers of at most {MOST_COMMAND:,.0f}")
    places = np.cumsum(arrays["map_places"], dtype=np.int64)
    if int(arrays["map_counts"].sum()) != changed or (
        changed and not 0 <= int(places.min()) <= int(places.max()) < rows * words
    ):
        raise ValueError(f"the changes of the map do not fit a map of {rows} x {words} words")
    if not (poses and samples) or not isinstance(events, list) or not all(_is_event(event) for event in events):
        raise ValueError("it has no poses, no map or no list of events")
    changes = MapChanges(
        rows,
        words,
        arrays["map_steps"] * time_step,
        arrays["map_counts"].astype(np.int64),
        places,
        arrays["map_known"],
        arrays["map_occupied"],
    )
    display = DisplayTrack(
        arrays["pose_steps"] * time_step,
        np.cumsum(arrays["poses"], axis=0, dtype=np.int64) / _UNITS,
        np.stack([arrays["coverage"][:, 0] * time_step, arrays["coverage"][:, 1] / counted], axis=1),
        (header["map_origin"][0], header["map_origin"][1]),
        header["map_resolution"],
        changes,
        events,
        _unpacked_crowd(crowd, time_step),
    )
    return EpisodeRecord(header, arrays["commands"], display)


def _steps(times: NDArray[np.float64], time_step: float) -> NDArray[np.int32]:
    return np.rint(times / time_step).astype(np.int32)


def _is_event(event: Any) -> bool:  # noqa: ANN401
    return (
        isinstance(event, dict)
        and isinstance(event.get("kind"), str)
        and TIME.hold(event.get("time_s"))
        and "agent" in event
        and _is_place(event.get("x"), event.get("y"))
    )


def _is_place(x: Any, y: Any) -> bool:  # noqa: ANN401
    """Whether both are numbers or neither is known."""
    return (x is None and y is None) or all(type(each) in (int, float) and math.isfinite(each) for each in (x, y))
