"""Which floor an episode takes: a named one, or one drawn from many."""

import math
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from lidarium.envs.floors.catalogue.names import check_floor, is_file_name, is_generated, load_floor, set_floors
from lidarium.envs.floors.floor import Floor
from lidarium.envs.floors.importers import FORMATS, is_floor, ros_map, takes_resolution
from lidarium.mapping.geometry.bounds import shown

SET_PREFIX = "set:"

FloorName = str | Path | Floor
"""A name of the catalogue, a set, a folder, a file, or a floor."""

Grid = np.ndarray[Any, np.dtype[Any]]

Floors = FloorName | Grid | Sequence[Any] | Mapping[Any, float] | Callable[[np.random.Generator], Any]
"""Floors that an environment takes; see `FloorChoice`."""


class FloorChoice:
    """A floor, or many of which each episode draws one.

    Parameters
    ----------
    floor : str, Path, Floor, array, sequence, mapping or callable
        A name of the catalogue, a path, a floor, or an array as `load_floor` takes it; or many: ``set:NAME``, a folder
        of files that the importers know, a list, a mapping from floors to their weights, or a callable that takes the
        episode's generator and returns a floor. Those of a list or mapping may be sets and folders themselves.
    image_resolution : float or None
        Side of a pixel [m] of floors that are plain images or arrays.

    Attributes
    ----------
    is_set : bool
        Whether there are many.
    has_goal : bool
        Whether the floor has a goal; of many, whether the first one has. That of a callable has none.
    """

    def __init__(self, floor: Floors, image_resolution: float | None = None) -> None:
        if isinstance(floor, np.ndarray):
            floor, image_resolution = load_floor(floor, image_resolution), None
        self._image_resolution = image_resolution
        self._source: Callable[[np.random.Generator], Any] | None = None
        self._weights: np.ndarray[Any, np.dtype[np.float64]] | None = None
        self._specs: tuple[Any, ...] = ()
        if isinstance(floor, str | Path | Floor):
            self._specs = single_floors(floor)
            self.is_set = self._specs != (floor,)
            if not self.is_set and isinstance(floor, str) and not is_file_name(floor):
                # A floor of the catalogue never changes, and is looked up once.
                self._specs = (self._load(floor),)
        elif callable(floor):
            self._source, self.is_set = floor, True
        elif isinstance(floor, Mapping | Sequence) and len(floor):
            self._weights = _shares(floor) if isinstance(floor, Mapping) else None
            self._specs, self.is_set = tuple(map(self._member, floor)), True
        else:
            raise ValueError(
                f"floor is {shown(floor)}; want a name such as apartment, building:17 or set:train, a path, "
                "a Floor, or many of them: a list, a folder, a mapping to weights, a callable"
            )
        self.has_goal = self._first_has_goal(floor)

    def _member(self, floor: Any) -> Any:  # noqa: ANN401
        """Return a floor of a list, or the choice that it is itself; one that is not there must not fail later."""
        if self._holds_choices(floor):
            return self.instead(floor)
        if not isinstance(floor, Floor):
            check_floor(floor)
        return floor

    def _first_has_goal(self, floor: Floors) -> bool:
        """Whether the first floor has a goal.

        Generated floors have none, and are not generated to be asked.
        """
        if self._source is not None or (isinstance(floor, str) and floor.startswith(SET_PREFIX)):
            return False
        first = self._specs[0]
        if isinstance(first, FloorChoice):
            return first.has_goal
        return not (isinstance(first, str) and is_generated(first)) and self._load(first).goal is not None

    def instead(self, floor: Floors) -> "FloorChoice":
        """Return the choice of another floor or of others.

        The side of a pixel concerns files only.
        """
        return FloorChoice(floor, self._resolution_of(floor))

    def in_files(self) -> dict[str, str]:
        """Return the hashes of its floors in files, by the names of these."""
        found: dict[str, str] = {}
        for spec in self._specs:
            if isinstance(spec, FloorChoice):
                found |= spec.in_files()
            elif isinstance(spec, str | Path) and is_file_name(str(spec)):
                found[str(spec)] = self._load(spec).sha256
        return found

    def load(self, generator: np.random.Generator) -> Floor:
        """Return the floor of the next episode."""
        if self._source is not None:
            return self.instead(self._source(generator)).load(generator)
        spec = self._specs[self._draw(generator)]
        return spec.load(generator) if isinstance(spec, FloorChoice) else self._load(spec)

    def _draw(self, generator: np.random.Generator) -> int:
        count = len(self._specs)
        if count == 1:
            return 0
        if self._weights is None:
            return int(generator.integers(count))
        return int(generator.choice(count, p=self._weights))

    def _load(self, spec: FloorName) -> Floor:
        if isinstance(spec, Floor):
            return spec
        return load_floor(spec, pixel_side(spec, self._image_resolution, is_alone=not self.is_set))

    def _resolution_of(self, spec: Any) -> float | None:  # noqa: ANN401
        """Return the side of a pixel for files, folders and choices; None for floors by name."""
        is_named = isinstance(spec, Floor) or (isinstance(spec, str) and not is_file_name(spec))
        return None if is_named else self._image_resolution

    @staticmethod
    def _holds_choices(spec: Any) -> bool:  # noqa: ANN401
        if isinstance(spec, Floor):
            return False
        return not isinstance(spec, str | Path) or str(spec).startswith(SET_PREFIX) or _is_folder(spec)


def pixel_side(floor: str | Path, image_resolution: float | None, is_alone: bool) -> float | None:
    """Return the side of a pixel to read a floor with [m].

    A floor alone is refused with a side that it cannot have; of many it concerns those that do not state theirs.
    """
    if is_alone or image_resolution is None:
        return image_resolution
    return image_resolution if is_file_name(floor) and takes_resolution(Path(floor)) else None


def single_floors(floor: FloorName) -> tuple[FloorName, ...]:
    """Return the floors of a set or of a folder; any other floor alone."""
    if isinstance(floor, str) and floor.startswith(SET_PREFIX):
        return set_floors(floor.removeprefix(SET_PREFIX))
    return _folder_floors(Path(floor)) if not isinstance(floor, Floor) and _is_folder(floor) else (floor,)


def _is_folder(floor: Any) -> bool:  # noqa: ANN401
    """Whether a floor is named by a folder; names of the catalogue go before folders."""
    if isinstance(floor, Path):
        return floor.is_dir()
    return isinstance(floor, str) and ("/" in floor or "\\" in floor) and Path(floor).is_dir()


def _folder_floors(folder: Path) -> tuple[Path, ...]:
    """Return the files of a folder that are floors, in the order of their names.

    Pictures next to the description of a ROS map of the same name belong to it.
    """
    files = sorted(path for path in folder.iterdir() if path.is_file() and is_floor(path))
    described = {path.stem for path in files if path.suffix.lower() in ros_map.SUFFIXES}
    is_own = (path.stem not in described or path.suffix.lower() in ros_map.SUFFIXES for path in files)
    floors = tuple(path for path, keeps in zip(files, is_own, strict=True) if keeps)
    if not floors:
        suffixes = sorted({suffix for known in FORMATS.values() for suffix in known.suffixes})
        raise ValueError(f"folder {str(folder)!r} has no floors; want files that end in {', '.join(suffixes)}")
    return floors


def _shares(weights: Mapping[Any, float]) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Return weights as shares of their sum."""
    for floor, weight in weights.items():
        is_number = isinstance(weight, int | float | np.number) and not isinstance(weight, bool)
        if not (is_number and 0 < weight <= sys.float_info.max):
            raise ValueError(f"the weight of floor {shown(floor)} is {shown(weight)}; want a positive number")
    if not math.isfinite(total := sum(map(float, weights.values()))):
        raise ValueError(f"the weights of the floors add up to {total}; want a finite sum")
    numbers = np.array([float(weight) for weight in weights.values()])
    return np.asarray(numbers / numbers.sum())
