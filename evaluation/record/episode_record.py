"""A recorded episode: its header, and data that any version can show (paths, coverage, map, events)."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

import lidarium
from lidarium.envs.settings.exploration import PARTS, ExplorationSettings, with_parts
from lidarium.envs.simulation.people.crowd import Crowd
from lidarium.mapping.files.guarded_reading import reason
from lidarium.mapping.geometry.bounds import Rule, above, check_values, rules_of, shown, within
from lidarium.mapping.grids.map_deltas import levels_of_planes


@dataclass(frozen=True, slots=True, eq=False)
class MapChanges:
    """Changes of the team's three-level map from sample to sample.

    They begin with a map of which nothing is known.

    Two planes of bits hold the map, one of known and one of occupied cells; a word has 64 cells of a row, bit
    0 the first one.

    Attributes
    ----------
    rows, words : int
        Shape of the planes.
    times : (samples,) float64
        When the samples were taken, ascending [s].
    counts : (samples,) int64
        Number of words that each sample changed.
    places : (changes,) int64
        Which words, word of the row * rows + row, ascending within a sample; the samples one after the other.
    known, occupied : (changes,) uint64
        Which bits of the words flipped.
    """

    rows: int
    words: int
    times: NDArray[np.float64]
    counts: NDArray[np.int64]
    places: NDArray[np.int64]
    known: NDArray[np.uint64]
    occupied: NDArray[np.uint64]

    def levels_at(self, time_s: float) -> NDArray[np.uint8]:
        """Return the map of the last sample up to a time, shape (rows, words * 64).

        Values are 0 occupied, 127 unknown, 255 free.
        """
        samples = int(np.searchsorted(self.times, time_s + 1e-9, side="right"))
        changes = int(self.counts[:samples].sum())
        planes = np.zeros((2, self.rows * self.words), np.uint64)
        for plane, flipped in zip(planes, (self.known, self.occupied), strict=True):
            np.bitwise_xor.at(plane, self.places[:changes], flipped[:changes])
        known, occupied = planes.reshape(2, self.words, self.rows)
        return levels_of_planes(known.T, occupied.T)


@dataclass(frozen=True, slots=True, eq=False)
class CrowdTrack:
    """People and doors of an episode over time.

    Attributes
    ----------
    times : (n,) float64
        When they were sampled: five times a second [s].
    people : (n, people, 3) float64
        x, y and radius in the floor's frame, rounded to 1 mm [m].
    doors : (doors, 4) float64
        Ends of the openings, rounded alike [m].
    opened : (n, doors) float64
        Share by which each is open, rounded to 1 %.
    """

    times: NDArray[np.float64]
    people: NDArray[np.float64]
    doors: NDArray[np.float64]
    opened: NDArray[np.float64]

    def at(self, time_s: float) -> Crowd:
        """Return the last sample up to a time; before the first one, the first."""
        sample = max(int(np.searchsorted(self.times, time_s + 1e-9, side="right")) - 1, 0)
        return Crowd(self.people[sample], self.doors, self.opened[sample])


@dataclass(frozen=True, slots=True, eq=False)
class DisplayTrack:
    """Data of an episode that any version can show.

    Attributes
    ----------
    times : (n,) float64
        When poses were sampled: five times a second, and at the end [s].
    poses : (n, robots, 3) float64
        True x, y, theta of each robot in the floor's frame, rounded to 1 mm and 1 mrad [m, rad].
    coverage : (m, 2) float64
        Time [s] and ``C_free`` from then on, at every change.
    origin : (x, y)
        Lower left corner of cell (0, 0) of the team's map in the floor's frame [m].
    resolution : float
        Side of a cell of the team's map [m].
    changes : MapChanges
        The team's map over time, every two seconds and at the end.
    events : list of dict
        Each with ``time_s``, ``kind``, ``agent`` and keys of its own, in order of time;
        docs/reference/files.md lists the kinds.
    crowd : CrowdTrack or None
        People and doors; None without any.
    """

    times: NDArray[np.float64]
    poses: NDArray[np.float64]
    coverage: NDArray[np.float64]
    origin: tuple[float, float]
    resolution: float
    changes: MapChanges
    events: list[dict[str, Any]]
    crowd: CrowdTrack | None = None

    def crowd_at(self, time_s: float) -> Crowd | None:
        """Return people and doors at a time; None without any."""
        return None if self.crowd is None else self.crowd.at(time_s)

    def map_at(self, time_s: float) -> NDArray[np.uint8]:
        """Return the team's map of the last sample up to a time.

        Values are 0 occupied, 127 unknown, 255 free; the shape is (rows, columns).
        """
        return self.changes.levels_at(time_s)

    def poses_at(self, time_s: float) -> NDArray[np.float64]:
        """Return the last sampled poses up to a time, shape (robots, 3).

        Before the first sample they are the poses of the start.
        """
        return np.asarray(self.poses[max(int(np.searchsorted(self.times, time_s + 1e-9, side="right")) - 1, 0)])

    def coverage_at(self, time_s: float) -> float:
        """Return ``C_free`` at a time."""
        changes = int(np.searchsorted(self.coverage[:, 0], time_s + 1e-9, side="right"))
        return float(self.coverage[changes - 1, 1]) if changes else 0.0


FORMAT = 1
"""Number of the format of records that this version writes.

It reads this one and those before.
"""


@dataclass(frozen=True, slots=True, eq=False)
class EpisodeRecord:
    """An episode to be run again by its version and shown by any.

    Its version is the one that recorded it.

    Attributes
    ----------
    header : dict
        Version, settings, values drawn at the beginning, endings and the hash of the final state;
        docs/reference/files.md lists it all.
    commands : (steps, robots, 2) float64
        Speed and turn rate at which each robot was driven in each time step, to the bit [m/s, rad/s].
    display : DisplayTrack
        Data that can be shown.
    """

    header: dict[str, Any]
    commands: NDArray[np.float64]
    display: DisplayTrack

    @property
    def predicts(self) -> bool:
        """Whether robots predicted their maps by the network, so that replays show it; older records do not say so."""
        return self.header.get("predicts") is True


class NewerFormatError(ValueError):
    """A record is of a format that this version does not know yet."""


TIME = Rule(float, bounds=within(0.0, 1e12))
"""Valid times of a record [s]."""

_SIDE = Rule(float, bounds=above(0.0, 1000.0))
_NUMBER = Rule(float, bounds=within(-1e9, 1e9))
_COUNT = Rule(int, bounds=within(0, 1e12))
_SEED = Rule(int, bounds=within(0, math.inf))
_ROBOTS = Rule(int, bounds=within(1, 64))

MOST_MAP_WORDS = 1 << 22
"""Maximum number of words of 64 cells of the map of a record."""


def _is_shape(value: Any) -> bool:  # noqa: ANN401
    is_pair = isinstance(value, list) and len(value) == 2 and all(_COUNT.hold(side) for side in value)
    return is_pair and value[0] * value[1] <= MOST_MAP_WORDS


def _is_hash(value: Any) -> bool:  # noqa: ANN401
    return isinstance(value, str) and len(value) == 64


def _are_numbers(value: Any, count: int) -> bool:  # noqa: ANN401
    return isinstance(value, list) and len(value) == count and all(_NUMBER.hold(number) for number in value)


def _is_ending(value: Any) -> bool:  # noqa: ANN401
    return (
        isinstance(value, list)
        and len(value) == 3
        and _COUNT.hold(value[0])
        and all(isinstance(word, str) for word in value[1:])
    )


_WANTED: dict[str, tuple[str, Callable[[Any], bool]]] = {
    "version": ("text", lambda value: isinstance(value, str)),
    "policy": ("text", lambda value: isinstance(value, str)),
    "seed": ("a whole number or null", lambda value: value is None or _SEED.hold(value)),
    "floor": ("text", lambda value: isinstance(value, str)),
    "floor_source": ("text or null", lambda value: value is None or isinstance(value, str)),
    "floor_sha256": ("64 hexadecimal digits", _is_hash),
    "image_resolution": ("a number or null", lambda value: value is None or _SIDE.hold(value)),
    "robots": ("a whole number from 1 to 64", _ROBOTS.hold),
    "time_step": ("a number above 0", _SIDE.hold),
    "settings": ("an object", lambda value: isinstance(value, dict)),
    "settings_sha256": ("64 hexadecimal digits", _is_hash),
    "starts": (
        "a list of x, y, theta",
        lambda value: isinstance(value, list) and all(_are_numbers(start, 3) for start in value),
    ),
    "noise_seed": ("a whole number", _SEED.hold),
    "goal": ("x, y or null", lambda value: value is None or _are_numbers(value, 2)),
    "steps": ("a whole number", _COUNT.hold),
    "counted_cells": ("a whole number", _COUNT.hold),
    "map_origin": ("x, y", lambda value: _are_numbers(value, 2)),
    "map_resolution": ("a number above 0", _SIDE.hold),
    "map_shape": ("two whole numbers of a map that is not too large", _is_shape),
    "endings": (
        "a list of step, robot, reason",
        lambda value: isinstance(value, list) and all(_is_ending(ending) for ending in value),
    ),
    "interrupted": ("true or false", lambda value: isinstance(value, bool)),
    "final_sha256": ("64 hexadecimal digits or null", lambda value: value is None or _is_hash(value)),
}
"""Valid values of each key of a header, in words and as a test."""


_MAY_HAVE = {"predicts": _WANTED["interrupted"]}
"""The same of keys that older records do not have."""


def check_header(header: Any) -> None:  # noqa: ANN401
    """Check the header of a record as read from a file.

    Keys that are not known are left alone.
    """
    number: Any = header.get("format") if isinstance(header, dict) else None
    if not _COUNT.hold(number):
        raise ValueError("its header is not an object with the number of its format")
    if number > FORMAT:
        version = shown(header.get("version")).strip("'")
        raise NewerFormatError(
            f"is an episode record of format {number}, written by lidarium {version}; "
            f"this is lidarium {lidarium.__version__}, which reads formats up to {FORMAT}: use the newer "
            "version"
        )
    known = {**_WANTED, **{name: rule for name, rule in _MAY_HAVE.items() if name in header}}
    for name, (wanted, is_good) in known.items():
        if name not in header:
            raise ValueError(f"its header has no key {name}")
        if not is_good(header[name]):
            raise ValueError(f"its header has {name} {shown(header[name])}; want {wanted}")
    _check_settings(header["settings"])
    if len(header["starts"]) != header["robots"]:
        raise ValueError(f"its header has {len(header['starts'])} starts for {header['robots']} robots")


def _check_settings(settings: dict[str, Any]) -> None:
    """Check the parts of settings that pictures and pages are made from, as settings are checked."""
    rules = rules_of(ExplorationSettings)
    for name, part in PARTS.items():
        value = settings.get(name)
        if value is None:
            continue
        try:
            if not isinstance(value, dict):
                raise ValueError(f"want an object instead of {shown(value)}")
            check_values(value, rules[name].inner, name)
            with_parts(part, value)
        except (TypeError, ValueError, OverflowError, AttributeError) as error:
            raise ValueError(f"its header has settings with a {name} that cannot be used: {reason(error)}") from error
