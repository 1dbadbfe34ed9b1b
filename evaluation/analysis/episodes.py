"""Reads the episodes of a directory that `lidarium evaluate` wrote.

Episodes that do not belong together are refused.
"""

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lidarium.evaluation.suites.episodes_file import KEY, TIMINGS, read_failures, read_lines
from lidarium.mapping.files.guarded_reading import printable
from lidarium.mapping.geometry.bounds import Rule, shown, within

Row = dict[str, Any]
"""A line of ``episodes.jsonl``: the result of `result_of`."""

FILE = "episodes.jsonl"

_TEXT, _FIGURE, _COUNT = Rule(str), Rule(float, bounds=within(0.0, 1e12)), Rule(int, bounds=within(0, 1e12))
_WANTED: dict[str, Rule] = {
    "floor": _TEXT,
    "floor_sha256": _TEXT,
    "robots": Rule(int, bounds=within(1, 64)),
    "policy": _TEXT,
    "seed": Rule(int, bounds=within(0, 2**63)),
    "interrupted": Rule(bool),
    "coverage_final": _FIGURE,
    "time_s": _FIGURE,
    "overlap": _FIGURE,
    "collisions": _COUNT,
    "version": _TEXT,
    "settings_sha256": _TEXT,
}
_NAMES = ("floor", "floor_sha256", "policy", "version", "settings_sha256")
MOST_LETTERS = 1000
"""Longest name of a line."""

_GROUPS = ("path_m", "ended_because")
_MAY_BE_NULL = ("horizon_s", "t90_s", "t99_s")
_OF_SETTINGS = ("backend", "localization", "realism", "horizon_s")
"""Keys of a line that describe the settings in addition to their hash."""


@dataclass(frozen=True, slots=True)
class Episodes:
    """Episodes of one version and, for each number of robots, of one set of settings.

    Attributes
    ----------
    rows : tuple of dict
        One for each episode, in the order of the file.
    version : str
        Version of lidarium.
    warnings : tuple of str
        Parts that were left out, and why.
    """

    rows: tuple[Row, ...]
    version: str
    warnings: tuple[str, ...] = ()


class NoEpisodesError(ValueError):
    """Raised for a folder in which no episode has finished."""


def read_episodes(directory: Path) -> Episodes:
    """Read ``episodes.jsonl``."""
    path = Path(directory) / FILE
    if not path.is_file():
        raise FileNotFoundError(f"no {FILE} in {directory}; want a folder that `lidarium evaluate --out` wrote")
    lines = read_lines(path)
    numbered, warnings = lines.numbered, []
    if lines.cut_off is not None:
        number, size = lines.cut_off
        warnings = [
            f"Line {number} of {path.name} breaks off ({size} bytes) and was left out: its episode was not finished."
        ]
    for number, row in numbered:
        _check_row(row, f"{path}, line {number}")
    kept, doubled = _without_doubles(numbered, path)
    if failed := read_failures(Path(directory)):
        key, why = next(iter(failed.items()))
        warnings.append(f"Failed episodes, which are missing here: {len(failed)}, first {key}: {why}.")
    if not kept:
        raise NoEpisodesError(f"{path} has no finished episode; run `lidarium evaluate` on")
    _check_alike(kept, path)
    rows = tuple(row for _, row in kept)
    _tell_floors_apart(rows)
    return Episodes(rows, str(rows[0]["version"]), (*warnings, *doubled))


def _tell_floors_apart(rows: Sequence[Row]) -> None:
    """Add the beginning of their hashes to the names of different floors of one name, such as ``map``."""
    hashes: dict[str, set[str]] = {}
    for row in rows:
        hashes.setdefault(row["floor"], set()).add(row["floor_sha256"])
    for row in rows:
        if len(hashes[row["floor"]]) > 1:
            row["floor"] = f"{row['floor']} ({row['floor_sha256'][:6]})"


def _key_of(row: Row) -> tuple[Any, ...]:
    """Return the key of an episode: its policy, and the pairing key."""
    return str(row["policy"]), *pair_key_of(row)


def pair_key_of(row: Row) -> tuple[Any, ...]:
    """Return the key that partners of a pair share.

    They share settings, floor, starts, seed and number of robots.
    """
    return (
        variant_of(row),
        row["floor"],
        row["floor_sha256"],
        json.dumps(row.get("starts")),
        row["seed"],
        row["robots"],
    )


def variant_of(row: Row) -> str:
    """Return the name of an episode's settings, empty if it has none."""
    return str(row.get("variant") or "")


def name_of(row: Row) -> str:
    """Name an episode for people."""
    return f"{row['policy']} on {row['floor']}, {row['robots']} robots, seed {row['seed']}"


def _check_row(row: Row, where: str) -> None:
    for key in (*_WANTED, *_GROUPS, *_MAY_BE_NULL):
        if key not in row:
            raise ValueError(f"{where} has no key {key!r}; want what `lidarium run` writes to result.json")
    for key, rule in _WANTED.items():
        if not rule.hold(row[key]):
            raise ValueError(f"{where} has {key} {shown(row[key])}; want {rule.wanted}")
    for key in (*_NAMES, *({"variant"} & row.keys())):
        row[key] = printable(str(row[key] or ""))
        if len(row[key]) > MOST_LETTERS:
            raise ValueError(f"{where} has {key} {shown(row[key])}; want at most {MOST_LETTERS} letters")
    paths = row["path_m"] if isinstance(row["path_m"], list) else [None]
    for key, is_good in (
        ("path_m", len(paths) > 0 and all(_FIGURE.hold(path) for path in paths)),
        ("ended_because", isinstance(row["ended_because"], dict)),
    ):
        if not is_good:
            raise ValueError(f"{where} has {key} {shown(row[key])}; want what `lidarium run` writes to result.json")
    for key in (*_MAY_BE_NULL, *({"bound_s"} & row.keys())):
        if row[key] is not None and not _FIGURE.hold(row[key]):
            raise ValueError(f"{where} has {key} {shown(row[key])}; want seconds or null")


def _without_doubles(numbered: Iterable[tuple[int, Row]], path: Path) -> tuple[list[tuple[int, Row]], list[str]]:
    kept: dict[tuple[Any, ...], tuple[int, Row]] = {}
    warnings = []
    for number, row in numbered:
        known = kept.setdefault((*_key_of(row), row["version"], row["settings_sha256"]), (number, row))
        if known[1] is row:
            continue
        # A floor may have two names, and an episode a record in one of two folders that were joined.
        compared = sorted({*known[1], *row} - {*TIMINGS, KEY, "record"})
        differing = [key for key in compared if known[1].get(key) != row.get(key)]
        if differing:
            raise ValueError(
                f"{path}, lines {known[0]} and {number} tell of the same episode ({name_of(row)}) but differ "
                f"in {', '.join(differing)}; "
                "want each episode once"
            )
        warnings.append(
            f"Lines {known[0]} and {number} of {path.name} are the same episode ({name_of(row)}), which is "
            "counted once."
        )
    return list(kept.values()), warnings


def _check_alike(numbered: Iterable[tuple[int, Row]], path: Path) -> None:
    """Refuse episodes of two versions, or of two sets of settings under one name.

    The name of the settings is checked for each number of robots.
    """
    first: tuple[int, Row] | None = None
    alike: dict[tuple[str, int], tuple[int, Row]] = {}
    rules: dict[tuple[str, str], tuple[int, Row]] = {}
    for number, row in numbered:
        first = first or (number, row)
        if row["version"] != first[1]["version"]:
            raise ValueError(
                f"{path} has episodes of two versions: {first[1]['version']} in line {first[0]} and "
                f"{row['version']} in line {number}; "
                "want one version in a directory"
            )
        known_number, known = alike.setdefault((variant_of(row), row["robots"]), (number, row))
        if row["settings_sha256"] != known["settings_sha256"]:
            seen = [
                f"{key} {known.get(key)} and {row.get(key)}" for key in _OF_SETTINGS if known.get(key) != row.get(key)
            ]
            differing = (
                ", ".join(seen)
                or f"settings_sha256 {known['settings_sha256'][:12]}... and {row['settings_sha256'][:12]}..."
            )
            raise ValueError(
                f"{path} has episodes of two settings with {row['robots']} robots, in lines {known_number} "
                f"and {number}: {differing}; "
                "want a name for each set of settings"
            )
        rule_number, other = rules.setdefault((row["policy"], variant_of(row)), (number, row))
        if {"setup_sha256"} <= row.keys() & other.keys() and row["setup_sha256"] != other["setup_sha256"]:
            raise ValueError(
                f"{path} has episodes of {row['policy']} with two options of the policy, rules to stop or ways to "
                f"start, in lines {rule_number} and {number}; want a directory for each"
            )
