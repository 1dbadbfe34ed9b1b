"""What a record holds, and which headers are good."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

import lidarium
from lidarium.evaluation.record.display import DisplayTrack
from lidarium.mapping.geometry.bounds import Rule, above, shown, within

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
        Version, settings, what was drawn at the beginning, endings and the hash of the final state;
        docs/reference/files.md lists it all.
    commands : (steps, robots, 2) float64
        Speed and turn rate at which each robot was driven in each time step, to the bit [m/s, rad/s].
    display : DisplayTrack
        What can be shown.
    """

    header: dict[str, Any]
    commands: NDArray[np.float64]
    display: DisplayTrack


class NewerFormatError(ValueError):
    """A record is of a format that this version does not know yet."""


TIME = Rule(float, bounds=within(0.0, 1e12))
"""What a time of a record has to be [s]."""

_SIDE = Rule(float, bounds=above(0.0, 1000.0))
_NUMBER = Rule(float, bounds=within(-1e9, 1e9))
_COUNT = Rule(int, bounds=within(0, 1e12))
_SEED = Rule(int, bounds=within(0, math.inf))
_ROBOTS = Rule(int, bounds=within(1, 64))

MOST_MAP_WORDS = 1 << 22
"""Most words of 64 cells of the map of a record."""


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
"""What each key of a header has to be, in words and as a test."""


def check_header(header: Any) -> None:  # noqa: ANN401
    """Check the header of a record as read from a file.

    Keys that are not known are left alone.

    Raises
    ------
    NewerFormatError
        Where the record is of a newer format than this version knows.
    ValueError
        Where a key is missing or has a bad value.
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
    for name, (wanted, is_good) in _WANTED.items():
        if name not in header:
            raise ValueError(f"its header has no key {name}")
        if not is_good(header[name]):
            raise ValueError(f"its header has {name} {shown(header[name])}; want {wanted}")
    if len(header["starts"]) != header["robots"]:
        raise ValueError(f"its header has {len(header['starts'])} starts for {header['robots']} robots")
