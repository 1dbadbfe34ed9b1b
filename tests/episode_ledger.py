"""Running hashes of what episodes tell, and public names found wherever they lie by now."""

import contextlib
import dataclasses
import enum
import hashlib
import importlib
import pkgutil
import re
import struct
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

NOT_HASHED = re.compile(r"decision_ms|tick_ms|peak_mb|steps_per_s|version|settings_sha256|wall_s|.*_ms$")
"""Keys of results that tell of the machine, or that change with every new setting."""

DOCUMENTED = {
    "run_episode": "lidarium.evaluation.episodes.runner",
    "WatchedExploration": "lidarium.evaluation.episodes.watching",
    "make_settings": "lidarium.envs.settings",
    "MergedMaps": "lidarium.envs.faces.merged_maps",
    "MergingSettings": "lidarium.envs.faces.merged_maps",
    "RadioSettings": "lidarium.envs.settings.radio",
    "RewardSettings": "lidarium.envs.settings.rewards",
    "Battery": "lidarium.envs.settings.battery",
    "Fault": "lidarium.envs.settings.faults",
    "FaultSettings": "lidarium.envs.settings.faults",
    "Order": "lidarium.envs.onboard.radio.messages",
    "OrderKind": "lidarium.envs.onboard.radio.messages",
    "Target": "lidarium.envs.onboard.radio.messages",
    "Floor": "lidarium.envs.floors.floor",
    "Solid": "lidarium.envs.floors.floor",
}
"""Names of docs/reference, with the place where they are today. One that has moved is sought by its name."""


def named(name: str) -> Any:
    """Return a documented class or function, wherever in its package it lies by now."""
    *parents, last = DOCUMENTED[name].split(".")
    top = importlib.import_module(".".join(parents[:2]))
    for place in (DOCUMENTED[name], ".".join([*parents[:2], last]), ".".join(parents), top.__name__):
        with contextlib.suppress(ImportError, AttributeError):
            return getattr(importlib.import_module(place), name)
    for found in pkgutil.walk_packages(top.__path__, f"{top.__name__}."):
        with contextlib.suppress(ImportError):
            thing = vars(importlib.import_module(found.name)).get(name)
            if getattr(thing, "__module__", None) == found.name:
                return thing
    raise ImportError(f"{name} is nowhere in {top.__name__}; tell DOCUMENTED what it is called now")


def leaves(value: Any, path: str = "") -> Iterator[tuple[str, bytes]]:
    """Yield path and bytes of all numbers, arrays and words in nested values, in a fixed order."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        value = {field.name: getattr(value, field.name) for field in dataclasses.fields(value)}
    if isinstance(value, Mapping):
        for key in sorted(value, key=str):
            yield from leaves(value[key], f"{path}/{key}" if path else str(key))
    elif isinstance(value, list | tuple) or (isinstance(value, np.ndarray) and value.dtype == object):
        yield path, b"list %d" % len(value)
        for inner in value:
            yield from leaves(inner, f"{path}/*")
    elif isinstance(value, np.ndarray):
        yield path, f"{value.dtype.str}{value.shape}".encode() + np.ascontiguousarray(value).tobytes()
    elif isinstance(value, enum.Enum):
        yield path, value.name.encode()
    elif isinstance(value, float | np.floating):
        yield path, b"f" + struct.pack("<d", float(value))
    elif isinstance(value, int | np.integer | np.bool_):
        yield path, b"i%d" % int(value)
    elif isinstance(value, str | None):
        yield path, repr(value).encode()


class Ledger:
    """Running hashes of an episode's parts, with a mark of each after every block of steps.

    Parameters
    ----------
    block : int
        Steps from mark to mark.
    known : mapping of str to list of str, or None
        For parts whose keys may become more: those that count. All count where None.
    """

    def __init__(self, block: int, known: Mapping[str, list[str]] | None) -> None:
        self.block, self.steps = block, 0
        self.known = None if known is None else {part: set(keys) for part, keys in known.items()}
        self.met: dict[str, set[str]] = {"infos": set(), "result": set(), "decisions": set()}
        self._hashes: dict[str, Any] = {}
        self._marks: dict[str, list[str]] = {}

    def add(self, part: str, value: Any) -> None:
        """Add what was told; its leaves in the order of their paths."""
        running = self._hashes.setdefault(part, hashlib.sha256())
        for path, content in leaves(value):
            key = re.sub(r"(?<![^/])(robot_)?\d+(?![^/])", "#", path)
            if part in self.met:
                if NOT_HASHED.match(path) or (self.known is not None and key not in self.known[part]):
                    continue
                self.met[part].add(key)
            running.update(path.encode() + b"\0" + content)

    def told(self, outcome: tuple[Any, ...]) -> None:
        """Add what ``reset`` (two) or ``step`` (five values) returned."""
        self.add("observations", outcome[0])
        if len(outcome) == 5:
            self.add("rewards", {"earned": outcome[1], "terminated": outcome[2], "truncated": outcome[3]})
            self.tick()
        self.add("infos", outcome[-1])

    def tick(self) -> None:
        """A step is over."""
        self.steps += 1
        if self.steps % self.block == 0:
            for part, running in self._hashes.items():
                self._marks.setdefault(part, []).append(running.hexdigest()[:8])

    def summary(self) -> dict[str, Any]:
        """Return what the JSON file keeps of an episode."""
        parts = {part: [running.hexdigest()[:32], *self._marks.get(part, [])] for part, running in self._hashes.items()}
        return {
            "steps": self.steps,
            "block": self.block,
            "parts": {part: " ".join(row) for part, row in parts.items()},
        }
