"""Data of the records of episodes for a report: coverage, paths and maps.

Coverage is over time.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lidarium.evaluation.analysis.episodes import Row
from lidarium.evaluation.record import read_record
from lidarium.mapping.grids.speckle_filter import without_small_components

FOLDER = "records"

Key = str
"""Path of an episode's record in the directory, as given in the episode's line.

Empty for no record.
"""

_SAME = ("policy", "floor_sha256", "seed", "robots", "settings_sha256")
"""Keys that a record and the line of its episode share."""


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
    """Data of a picture of one episode.

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
    """Read the coverage of the recorded episodes."""
    found: dict[Key, Entry] = {}
    warnings = []
    for row in rows:
        key = record_key(row)
        path = Path(directory) / key
        if not key or not path.exists():
            continue
        try:
            record = read_record(path)
        except (ValueError, OSError) as error:
            warnings.append(f"The record {path.name} was left out: {error}.")
            continue
        differing = [name for name in _SAME if record.header.get(name, row[name]) != row[name]]
        if differing:
            warnings.append(f"The record {path.name} was left out: it is of an episode with another {differing[0]}.")
            continue
        found[key] = Entry(path, np.asarray(record.display.coverage, np.float64))
    return found, warnings


def record_key(row: Row) -> Key:
    """Return the key that joins an episode and its record."""
    return str(row.get("record") or "")


def read_track(entry: Entry) -> Track:
    """Read the paths and the last map of a record."""
    display = read_record(entry.path).display
    levels = without_small_components(display.map_at(float(display.times[-1])))
    return Track(display.times, display.poses, levels, (display.origin[0], display.origin[1]), display.resolution)


def coverage_at(coverage: NDArray[np.float64], times: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the coverage of a step function at given times.

    From its end on, the last value holds.
    """
    places = np.searchsorted(coverage[:, 0], times + 1e-9, side="right") - 1
    return np.where(places >= 0, coverage[np.maximum(places, 0), 1], 0.0)
