"""What ``reset`` may be told, and which floor an episode takes."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.floors.catalogue import is_file_name, load_floor, set_floors
from lidarium.envs.floors.floor import Floor

SET_PREFIX = "set:"


class FloorChoice:
    """A floor, or a set of which each episode draws one.

    Parameters
    ----------
    floor : str, Path or Floor
        What the user named.
    image_resolution : float or None
        Side of a pixel [m] where the floor is a plain image.
    """

    def __init__(self, floor: str | Path | Floor, image_resolution: float | None = None) -> None:
        self._image_resolution = image_resolution
        if isinstance(floor, str) and floor.startswith(SET_PREFIX):
            self._specs: tuple[str | Path | Floor, ...] = set_floors(floor.removeprefix(SET_PREFIX))
            self.has_goal = False
        else:
            self._specs = (floor,)
            self.has_goal = load_floor(floor, image_resolution).goal is not None

    def instead(self, floor: str | Path | Floor) -> "FloorChoice":
        """Return the choice of another floor or set; the side of a pixel concerns files only."""
        return FloorChoice(floor, self._image_resolution if isinstance(floor, str | Path) and is_file_name(floor) else None)

    def load(self, generator: np.random.Generator) -> Floor:
        """Return the floor of the next episode."""
        spec = self._specs[0] if len(self._specs) == 1 else self._specs[int(generator.integers(len(self._specs)))]
        return load_floor(spec, self._image_resolution)


@dataclass(frozen=True, slots=True)
class ResetOptions:
    """Options of ``reset``, checked; None where not given."""

    floor: str | Path | Floor | None = None
    starts: NDArray[np.float64] | None = None
    goal: tuple[float, float] | None = None


def read_options(options: dict[str, Any] | None, robots: int) -> ResetOptions:
    """Check the options that are known and ignore the others.

    Raises
    ------
    ValueError
        Where a known option has a bad value.
    """
    if not options:
        return ResetOptions()
    starts = options.get("starts")
    if starts is not None:
        starts = np.asarray(starts, np.float64)
        if starts.shape != (robots, 3) or not np.isfinite(starts).all():
            raise ValueError(f"option starts has shape {starts.shape}; want ({robots}, 3): x, y [m] and theta [rad] of each robot")
    goal = options.get("goal")
    if goal is not None:
        place = np.asarray(goal, np.float64)
        if place.shape != (2,) or not np.isfinite(place).all():
            raise ValueError(f"option goal is {goal!r}; want two finite numbers: x, y [m]")
        goal = (float(place[0]), float(place[1]))
    return ResetOptions(options.get("floor"), starts, goal)
