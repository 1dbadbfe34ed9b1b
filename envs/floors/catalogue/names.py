"""The catalogue of floors.

It has floors by name, generated floors by seed, and the sets for training and testing.
"""

import difflib
import hashlib
import json
import os
from collections.abc import Iterable
from functools import lru_cache
from pathlib import Path
from typing import Any

from lidarium.envs.floors.catalogue.drawn import DATA, about_drawn, drawn_names, load_drawn
from lidarium.envs.floors.catalogue.store import floor_store, hash_of_code
from lidarium.envs.floors.floor import Floor
from lidarium.envs.floors.generation.buildings import KINDS, BuildingSettings, generate_building
from lidarium.envs.floors.generation.packing import packed_floor, unpacked_floor
from lidarium.envs.floors.importers import FORMATS, load_file
from lidarium.envs.floors.measures import measure_building
from lidarium.mapping.geometry.bounds import shown

SETS: dict[str, tuple[int, int]] = {
    "train": (1_000_000, 10_000),
    "validation": (2_000_000, 200),
    "test": (3_000_000, 200),
}
"""First seed and number of floors of each set.

Its floors are ``building:SEED`` with the generator's default settings.
"""

HASHED_FLOORS = 20
"""Number of floors of a set whose hashes are kept.

A change of the generator thus cannot pass unseen.
"""

GENERATORS = ("building", *KINDS)
"""Prefixes of generated floors: of any kind, or of one kind."""

MADE_BY = ("envs/floors", "mapping/files/output.py", "mapping/kernels")
"""Sources that determine generated floors, and how the store holds them."""


def floor_names() -> tuple[str, ...]:
    """Names of the drawn floors."""
    return drawn_names()


def about_floor(name: str) -> str:
    """Tell in one sentence what the drawn floor of that name is.

    Raises
    ------
    ValueError
        If there is no drawn floor of that name.
    """
    if name not in drawn_names():
        raise ValueError(_unknown(name))
    return about_drawn(name)


def load_floor(spec: str | Path | Floor, resolution: float | None = None) -> Floor:
    """Load a floor.

    Parameters
    ----------
    spec : str, Path or Floor
        A name of `floor_names`; ``building:SEED``, ``apartment:SEED``, ``office:SEED`` or ``corridors:SEED``;
        a path to a file of a format that the importers know; or a floor, which is returned as it is.
    resolution : float, optional
        Side of a cell [m] of files that do not say theirs; files only.

    Returns
    -------
    Floor
        Floors that are not files are kept, so that the same name gives the same object.

    Raises
    ------
    FileNotFoundError
        If the path leads nowhere.
    ValueError
        If there is no such floor, the seed is not a number, or the file cannot be read.
    """
    if isinstance(spec, Floor):
        return spec
    if is_file_name(spec):
        return load_file(Path(spec), resolution)
    if resolution is not None:
        raise ValueError(
            f"resolution {resolution} m is given for floor {spec!r}, which is not a file; leave it out"
        )
    return _load_named(spec)


def is_file_name(spec: str | Path) -> bool:
    """Return whether a floor is named by a path to a file."""
    if isinstance(spec, Path):
        return True
    suffixes = tuple(suffix for known in FORMATS.values() for suffix in known.suffixes)
    return (
        "/" in spec
        or "\\" in spec
        or spec.lower().endswith(suffixes)
        or (spec not in drawn_names() and os.path.isfile(spec))  # a name may be too long for one
    )


def is_generated(spec: str) -> bool:
    """Return whether a floor is named by a generator and a seed.

    Such a floor exists without a look-up.
    """
    prefix, colon, rest = spec.partition(":")
    return bool(colon) and prefix in GENERATORS and rest.isascii() and rest.isdigit()


def set_floors(name: str) -> tuple[str, ...]:
    """Floors of a set as specs for `load_floor`.

    Parameters
    ----------
    name : str
        "train", "validation" or "test", with or without ``set:`` before it; ``test:40`` are the first 40
        floors of it.

    Returns
    -------
    tuple of str

    Raises
    ------
    ValueError
        If there is no such set, or not as many floors in it.
    """
    short, colon, wanted = name.removeprefix("set:").partition(":")
    first, count = SETS[_set_name(short)]
    if colon:
        if not (wanted.isascii() and wanted.isdigit() and 1 <= int(wanted) <= count):
            raise ValueError(
                f"{name!r} wants {wanted!r} floors; the set {short} has {count}, as in "
                f"set:{short}:{min(count, 40)}"
            )
        count = int(wanted)
    return tuple(f"building:{seed}" for seed in range(first, first + count))


def set_sha256(name: str) -> str:
    """Look up the kept hash of a set: `hash_of_floors` of its first `HASHED_FLOORS`.

    Raises
    ------
    ValueError
        If there is no such set.
    """
    hashes = json.loads((DATA / "_sets.json").read_text(encoding="utf-8"))
    return str(hashes[_set_name(name)])


def hash_of_floors(specs: Iterable[str]) -> str:
    """Hash what some floors are: SHA-256 over the hashes of the floors, in order.

    Parameters
    ----------
    specs : iterable of str
        Floors as for `load_floor`.

    Returns
    -------
    str
        64 hexadecimal digits.
    """
    return hashlib.sha256("".join(load_floor(spec).sha256 for spec in specs).encode()).hexdigest()


def describe_floor(floor: Floor) -> dict[str, Any]:
    """Describe a floor in figures.

    Parameters
    ----------
    floor : Floor
        Any floor.

    Returns
    -------
    dict
        ``name``, ``size_m`` [width, height], ``area_m2`` (free), ``loops``, ``clutter``, ``rooms``,
        ``solids``, ``sha256``, ``remark``; what the four measures mean says `BuildingMeasures`.

    Raises
    ------
    ValueError
        If a robot of radius 0.30 m fits nowhere.
    """
    measures = measure_building(floor)
    x_min, y_min, x_max, y_max = floor.bounds
    return {
        "name": floor.name,
        "size_m": [round(x_max - x_min, 3), round(y_max - y_min, 3)],
        "area_m2": measures.area_m2,
        "loops": measures.loops,
        "clutter": measures.clutter,
        "rooms": measures.rooms,
        "solids": len(floor.solids),
        "sha256": floor.sha256,
        "remark": floor.remark,
    }


@lru_cache(maxsize=256)
def _load_named(spec: str) -> Floor:
    if spec in drawn_names():
        return load_drawn(DATA / f"{spec}.json")
    prefix, colon, rest = spec.partition(":")
    if prefix == "set" and colon:
        raise ValueError(
            f"{spec!r} is a set of many floors, not one; use set_floors({rest!r}) or one of them, such as "
            f"{_example(rest)!r}"
        )
    if prefix in GENERATORS and colon:
        if not (rest.isascii() and rest.isdigit()):
            raise ValueError(
                f"floor {spec!r} has seed {rest!r}; want a whole number of zero or more, as in {prefix}:17"
            )
        return _generated("any" if prefix == "building" else prefix, int(rest))
    raise ValueError(_unknown(spec))


def _generated(kind: str, seed: int) -> Floor:
    """Return a generated floor: that of the store, else a new one."""
    store, key = floor_store(), f"floor {kind}:{seed} {hash_of_code(*MADE_BY)}"
    kept = store.load(key)
    if kept is not None:
        return unpacked_floor(kept)
    floor = generate_building(seed, BuildingSettings(kind=kind))
    store.save(key, packed_floor(floor))
    return floor


def _set_name(name: str) -> str:
    short = name.removeprefix("set:")
    if short not in SETS:
        nearest = difflib.get_close_matches(short, SETS, n=1)
        raise ValueError(
            f"no set called {short!r}{f', did you mean {nearest[0]!r}?' if nearest else ''}; there are "
            f"{', '.join(SETS)}"
        )
    return short


def _example(name: str) -> str:
    first, _ = SETS.get(name, SETS["train"])
    return f"building:{first}"


def _unknown(name: str) -> str:
    forms = [f"{generator}:SEED" for generator in GENERATORS]
    nearest = difflib.get_close_matches(name[:100], [*drawn_names(), *forms], n=1, cutoff=0.5)
    guess = f", did you mean {nearest[0]!r}?" if nearest else ""
    return (
        f"no floor called {shown(name)}{guess}; there are {', '.join([*drawn_names(), *forms])}, and paths "
        "to files"
    )
