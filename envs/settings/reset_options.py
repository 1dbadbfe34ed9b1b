"""The options of ``reset``, and which floor an episode takes."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.floors.catalogue.names import is_file_name, load_floor, set_floors
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
        if not isinstance(floor, str | Path | Floor):
            raise ValueError(
                f"floor is {floor!r}; want a name such as apartment, building:17 or set:train, a path, or a "
                "Floor"
            )
        self._image_resolution = image_resolution
        if isinstance(floor, str) and floor.startswith(SET_PREFIX):
            self._specs: tuple[str | Path | Floor, ...] = set_floors(floor.removeprefix(SET_PREFIX))
            self.has_goal = False
        else:
            self._specs = (floor,)
            self.has_goal = load_floor(floor, image_resolution).goal is not None

    def instead(self, floor: str | Path | Floor) -> "FloorChoice":
        """Return the choice of another floor or set.

        The side of a pixel concerns files only.
        """
        return FloorChoice(
            floor, self._image_resolution if isinstance(floor, str | Path) and is_file_name(floor) else None
        )

    def load(self, generator: np.random.Generator) -> Floor:
        """Return the floor of the next episode."""
        spec = (
            self._specs[0]
            if len(self._specs) == 1
            else self._specs[int(generator.integers(len(self._specs)))]
        )
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
        poses = _numbers(starts)
        if poses is None or poses.shape != (robots, 3):
            what = f"is {starts!r}" if poses is None else f"has shape {poses.shape}"
            raise ValueError(
                f"option starts {what}; want ({robots}, 3) finite numbers: x, y [m] and theta [rad] of each "
                "robot"
            )
        starts = poses
    goal = options.get("goal")
    if goal is not None:
        place = _numbers(goal)
        if place is None or place.shape != (2,):
            raise ValueError(f"option goal is {goal!r}; want two finite numbers: x, y [m]")
        goal = (float(place[0]), float(place[1]))
    return ResetOptions(options.get("floor"), starts, goal)


def _numbers(value: Any) -> NDArray[np.float64] | None:  # noqa: ANN401
    """Return a value as an array, or None where it is not one of finite numbers."""
    try:
        array = np.asarray(value, np.float64)
    except (TypeError, ValueError):
        return None
    return array if np.isfinite(array).all() else None
