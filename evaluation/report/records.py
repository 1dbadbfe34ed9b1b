"""What a report takes from the records of episodes: coverage over time, ways and maps."""

from collections.abc import Iterable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.evaluation.report.episodes import Row

FOLDER = "records"

Key = tuple[str, str, str, int, int]
"""Policy, floor, its hash, seed, robots."""


@dataclass(frozen=True, slots=True)
class Entry:
    """A record, as far as all of them are kept.

    Attributes
    ----------
    path : Path
        The file.
    coverage : (m, 2) float64
        Time [s] and coverage from then on.
    """

    path: Path
    coverage: NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Track:
    """What a picture of one episode shows.

    Attributes
    ----------
    times : (n,) float64
        When poses were taken [s].
    poses : (n, robots, 3) float64
        [m, m, rad].
    levels : (rows, columns) uint8
        The team's map at the end: 0 occupied, 127 unknown, 255 free.
    origin : (x, y)
        Lower left corner of its cell (0, 0) [m].
    resolution : float
        Side of a cell [m].
    """

    times: NDArray[np.float64]
    poses: NDArray[np.float64]
    levels: NDArray[np.uint8]
    origin: tuple[float, float]
    resolution: float


def read_records(directory: Path, rows: Iterable[Row]) -> tuple[dict[Key, Entry], list[str]]:
    """Read the coverage of the recorded episodes.

    Parameters
    ----------
    directory : Path
        What `lidarium evaluate --out` wrote.
    rows : iterable of dict
        The episodes; records of others are passed over.

    Returns
    -------
    dict
        Records by `record_key`.
    list of str
        Which files could not be read, and why.
    """
    wanted = {record_key(row): str(row["settings_sha256"]) for row in rows}
    found: dict[Key, Entry] = {}
    warnings = []
    for path in sorted((Path(directory) / FOLDER).glob("*.npz")):
        try:
            record = _read(path)
        except (ValueError, OSError) as error:
            warnings.append(f"The record {path.name} was left out: {error}.")
            continue
        key = record_key(record.header)
        if wanted.get(key) == record.header.get("settings_sha256", wanted.get(key)) and key in wanted:
            found[key] = Entry(path, np.asarray(record.display.coverage, np.float64))
    return found, warnings


def record_key(row: Row) -> Key:
    """Return what joins episodes and records; both lines and headers have it."""
    return str(row["policy"]), str(row["floor"]), str(row["floor_sha256"]), row["seed"], row["robots"]


def read_track(entry: Entry) -> Track:
    """Read ways and the last map of a record."""
    display = _read(entry.path).display
    levels = display.map_at(float(display.times[-1]))
    return Track(display.times, display.poses, levels, (display.origin[0], display.origin[1]), display.resolution)


def coverage_at(coverage: NDArray[np.float64], times: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the coverage of a step function at given times, the last value from the end on."""
    places = np.searchsorted(coverage[:, 0], times + 1e-9, side="right") - 1
    return np.where(places >= 0, coverage[np.maximum(places, 0), 1], 0.0)


def _read(path: Path) -> Any:  # noqa: ANN401
    return import_module("lidarium.evaluation.record").read_record(path)
