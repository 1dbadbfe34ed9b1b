"""The catalogue of floors.

It has floors by name, generated floors by seed, and the sets for training and testing.
"""

import difflib
import hashlib
import json
import os
from collections.abc import Iterable, Mapping
from functools import lru_cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.floors.areas import left_out
from lidarium.envs.floors.catalogue.drawn import DATA, about_drawn, drawn_names, load_drawn
from lidarium.envs.floors.catalogue.real import COLLECTIONS, load_real, real_floors
from lidarium.envs.floors.catalogue.store import floor_store, hash_of_code
from lidarium.envs.floors.floor import Floor, Solid
from lidarium.envs.floors.free_space import measure_building, measure_reach
from lidarium.envs.floors.generation.buildings import KINDS, BuildingSettings, generate_building
from lidarium.envs.floors.importers import FORMATS, check_floor_file, load_file
from lidarium.mapping.files.map_files import RESOLUTION
from lidarium.mapping.geometry.bounds import shown


def _packed_floor(floor: Floor) -> dict[str, NDArray[Any]]:
    """Return a floor as flat arrays."""
    if floor.cells is not None:
        raise ValueError(f"floor {floor.name!r} is made of cells; want one of solids")
    rings = [ring for solid in floor.solids for ring in (solid.polygon, *solid.holes)]
    return {
        "name": np.frombuffer(floor.name.encode(), np.uint8),
        "bounds": np.array(floor.bounds, np.float64),
        "heights": np.array([(solid.z_low, solid.z_high) for solid in floor.solids], np.float64).reshape(-1, 2),
        "rings": np.array([1 + len(solid.holes) for solid in floor.solids], np.int64),
        "corners": np.array([len(ring) for ring in rings], np.int64),
        "points": np.concatenate([np.zeros((0, 2)), *rings]),
        "starts": floor.starts,
        "goal": np.array(floor.goal or (), np.float64),
    }


def _unpacked_floor(arrays: Mapping[str, NDArray[Any]]) -> Floor:
    """Return the floor that `_packed_floor` packed; its solids are views of the arrays."""
    ends = [0, *np.cumsum(arrays["corners"]).tolist()]
    rings = iter([arrays["points"][first:last] for first, last in pairwise(ends)])
    solids = tuple(
        Solid(next(rings), z_low, z_high, tuple(next(rings) for _ in range(count - 1)))
        for (z_low, z_high), count in zip(arrays["heights"].tolist(), arrays["rings"].tolist(), strict=True)
    )
    x_min, y_min, x_max, y_max = arrays["bounds"].tolist()
    goal = arrays["goal"].tolist()
    return Floor(
        name=arrays["name"].tobytes().decode(),
        bounds=(x_min, y_min, x_max, y_max),
        solids=solids,
        starts=arrays["starts"],
        goal=(goal[0], goal[1]) if goal else None,
    )


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
    """Return one sentence that describes the drawn floor of that name."""
    if name not in drawn_names():
        raise ValueError(_unknown(name))
    return about_drawn(name)


def load_floor(spec: str | Path | Floor | NDArray[Any], resolution: float | None = None) -> Floor:
    """Load a floor.

    Parameters
    ----------
    spec : str, Path or Floor
        A name of `floor_names`; ``building:SEED``, ``apartment:SEED``, ``office:SEED`` or ``corridors:SEED``; a real
        floor, such as ``home:17`` or ``robot_map:willow_garage_2010`` (``lidarium show floors``); a path to a file of
        a format that the importers know; an array (rows, columns) of grey levels (above 127 is free) or booleans (true
        is solid), row 0 at the top; or a floor, which is returned unchanged.
    resolution : float, optional
        Side of a cell [m] of arrays, and of files that do not state it.

    Returns
    -------
    Floor
        Floors that are not files are kept, so that the same name gives the same object.

    Raises
    ------
    FileNotFoundError
        If the file does not exist.
    ValueError
        If the floor is unknown, the seed is not a number, or the file cannot be read.

    Examples
    --------
    >>> import lidarium
    >>> lidarium.load_floor("apartment").name
    'apartment'
    """
    if isinstance(spec, Floor):
        return spec
    if isinstance(spec, np.ndarray):
        from lidarium.envs.floors.importers.arrays import floor_of_array

        if resolution is not None and not RESOLUTION.hold(resolution):
            raise ValueError(f"resolution is {resolution!r}; want {RESOLUTION.wanted}")
        return floor_of_array(spec, resolution)
    if is_file_name(spec):
        return load_file(Path(spec), resolution)
    if resolution is not None:
        raise ValueError(f"resolution {resolution} m is given for floor {spec!r}, which is not a file; leave it out")
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


@lru_cache(maxsize=1 << 16)
def check_floor(spec: str | Path) -> None:
    """Check that there is a floor of a name or path, for `load_floor`; none is generated, and no file is loaded."""
    if isinstance(spec, str) and (is_generated(spec) or spec in drawn_names()):
        return
    if is_file_name(spec):
        check_floor_file(Path(spec))
        return
    collection = str(spec).partition(":")[0]
    if collection not in COLLECTIONS or spec not in real_floors(collection):
        _load_named(str(spec))  # raises the error of an unknown name


def set_floors(name: str) -> tuple[str, ...]:
    """Return the names of all floors of a set, for `load_floor` and ``reset(options={"floor": ...})``.

    Parameters
    ----------
    name : str
        "train" (10,000 floors), "validation" or "test", or the real floors "home", "dungeon" or "robot_map"; with a
        count for the first ones: "test:40".

    Returns
    -------
    tuple of str
        Names of floors.

    Raises
    ------
    ValueError
        If the set is unknown, or has fewer floors.

    Examples
    --------
    >>> import lidarium
    >>> len(lidarium.floor_set("test:3"))
    3
    """
    short, colon, wanted = name.removeprefix("set:").partition(":")
    _check_set(short)
    if short in COLLECTIONS:
        floors = real_floors(short)
    else:
        first, count = SETS[short]
        floors = tuple(f"building:{seed}" for seed in range(first, first + count))
    if not colon:
        return floors
    if not (wanted.isascii() and wanted.isdigit() and 1 <= int(wanted) <= len(floors)):
        raise ValueError(
            f"{name!r} wants {wanted!r} floors; the set {short} has {len(floors)}, as in "
            f"set:{short}:{min(len(floors), 40)}"
        )
    return floors[: int(wanted)]


def _set_sha256(name: str) -> str:
    """Look up the kept hash of a set: `_hash_of_floors` of its first `HASHED_FLOORS`."""
    hashes = json.loads((DATA / "_sets.json").read_text(encoding="utf-8"))
    return str(hashes[name.removeprefix("set:")])


def _hash_of_floors(specs: Iterable[str]) -> str:
    """Hash floors: SHA-256 over the hashes of the floors, in order."""
    return hashlib.sha256("".join(load_floor(spec).sha256 for spec in specs).encode()).hexdigest()


def describe_floor(floor: Floor) -> dict[str, Any]:
    """Describe a floor in figures."""
    measures = measure_building(floor)
    x_min, y_min, x_max, y_max = floor.bounds
    return {
        "name": floor.name,
        "size_m": [round(x_max - x_min, 3), round(y_max - y_min, 3)],
        "area_m2": measures.area_m2,
        **_reach(floor, measures.left_out_m2, measures.whole_m2),
        "loops": measures.loops,
        "clutter": measures.clutter,
        "rooms": measures.rooms,
        "solids": len(floor.solids),
        "sha256": floor.sha256,
    }


def describe_reach(floor: Floor, start: NDArray[np.float64]) -> dict[str, Any]:
    """Say how much of a floor can be reached from a start, x, y, ... [m], and what is assumed and left out of it."""
    return _reach(floor, *measure_reach(floor, start))


def _reach(floor: Floor, left_out_m2: NDArray[np.float64], whole_m2: float) -> dict[str, Any]:
    return {
        "reachable_m2": round(whole_m2 - float(left_out_m2.sum()), 3),
        "whole_m2": round(whole_m2 + floor.left_out_m2, 3),
        "remark": "; ".join(each for each in (floor.remark, left_out(left_out_m2)) if each),
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
    if prefix in COLLECTIONS and colon:
        return load_real(spec)
    if prefix in GENERATORS and colon:
        if not (rest.isascii() and rest.isdigit()):
            raise ValueError(
                f"floor {spec!r} has seed {rest!r}; want a whole number of zero or more, as in {prefix}:17"
            )
        return _generated("any" if prefix == "building" else prefix, int(rest))
    raise ValueError(_unknown(spec))


def _generated(kind: str, seed: int) -> Floor:
    """Return a generated floor: that of the store if present, otherwise a new one."""
    store, key = floor_store(), f"floor {kind}:{seed} {hash_of_code(*MADE_BY)}"
    kept = store.load(key)
    if kept is not None:
        return _unpacked_floor(kept)
    floor = generate_building(seed, BuildingSettings(kind=kind))
    store.save(key, _packed_floor(floor))
    return floor


def _check_set(short: str) -> None:
    known = (*SETS, *COLLECTIONS)
    if short not in known:
        nearest = difflib.get_close_matches(short, known, n=1)
        raise ValueError(
            f"no set called {short!r}{f', did you mean {nearest[0]!r}?' if nearest else ''}; there are "
            f"{', '.join(known)}"
        )


def _example(name: str) -> str:
    first, _ = SETS.get(name, SETS["train"])
    return real_floors(name)[0] if name in COLLECTIONS else f"building:{first}"


def _unknown(name: str) -> str:
    forms = [f"{generator}:SEED" for generator in GENERATORS] + [f"{collection}:NAME" for collection in COLLECTIONS]
    nearest = difflib.get_close_matches(name[:100], [*drawn_names(), *forms], n=1, cutoff=0.5)
    guess = f", did you mean {nearest[0]!r}?" if nearest else ""
    return f"no floor called {shown(name)}{guess}; there are {', '.join([*drawn_names(), *forms])}, and paths to files"
