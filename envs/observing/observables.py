"""Observables that are functions: their registration, and the writer of their values."""

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from lidarium.envs.observing.rows import FARTHEST, Rows, check_finite
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.settings.observables import SENSED, Observable

OLDEST_S = 3600.0
"""Maximum age of information on others [s]."""


def _share(settings: ExplorationSettings) -> spaces.Box:
    return spaces.Box(0.0, 1.0, (1,), np.float32)


def time_left(rows: Rows) -> NDArray[np.float64]:
    """Return the share of the horizon that is left; 1 without a horizon."""
    horizon = rows.settings.horizon_steps
    if horizon is None:
        return np.ones((rows.robots * rows.episodes, 1))
    return np.asarray(1.0 - rows.time_s[:, None] / (horizon * rows.settings.time_step))


def coverage(rows: Rows) -> NDArray[np.float64]:
    """Return the true share of F that the team has seen."""
    return rows.coverage[:, None]


def teammates(rows: Rows) -> NDArray[np.float64]:
    """Return the state of each robot's teammates as it knows them, relative to its own position."""
    table = rows.teammates
    known = table[..., 7:] > 0.0
    here = rows.pose[:, None, :2]
    table[..., 0:2] = np.where(known, table[..., 0:2] - here, 0.0)
    table[..., 3:5] = np.where(table[..., 5:6] > 0.0, table[..., 3:5] - here, 0.0)
    return table


def teammate_box(settings: ExplorationSettings) -> spaces.Box:
    """Return the space of `teammates`."""
    turn = float(np.nextafter(np.float32(math.pi), np.float32(4.0)))
    high = np.array([FARTHEST, FARTHEST, turn, FARTHEST, FARTHEST, 1.0, OLDEST_S, 1.0], np.float32)
    low = np.where([1, 1, 1, 1, 1, 0, 0, 0], -high, 0.0).astype(np.float32)
    shape = (max(settings.robots - 1, 1), 1)
    return spaces.Box(np.tile(low, shape), np.tile(high, shape), dtype=np.float32)


def _missing_others(settings: ExplorationSettings) -> str:
    return "" if settings.robots > 1 else "two robots or more"


TIME_LEFT = Observable(_share, compute=time_left)
COVERAGE = Observable(_share, compute=coverage)
TEAMMATES = Observable(teammate_box, _missing_others, teammates)


def observable(
    name: str, low: float, high: float, shape: tuple[int, ...], summary: str = ""
) -> Callable[[Callable[[Rows], NDArray[Any]]], Callable[[Rows], NDArray[Any]]]:
    """Register a function as an observable; ``observe`` then takes its name, in batches as well.

    Parameters
    ----------
    name : str
        Name of the observable.
    low, high : float
        Bounds; values beyond are clipped.
    shape : tuple of int
        Shape of the value of one robot.
    summary : str, optional
        One line that describes it; the first line of the function's docstring by default.

    Returns
    -------
    callable
        A decorator of a function that takes ``Rows`` and returns an array of shape ``(rows, *shape)``.

    Raises
    ------
    ValueError
        If the name is taken.

    Examples
    --------
    >>> import lidarium, numpy as np
    >>> @lidarium.observable("clearance", low=0.0, high=4.0, shape=(1,), summary="minimum range [m]")
    ... def clearance(rows):
    ...     return np.nan_to_num(rows.scan, nan=4.0, posinf=4.0).min(axis=1, keepdims=True)
    """
    box = spaces.Box(low, high, shape, np.float32)

    def register(function: Callable[[Rows], NDArray[Any]]) -> Callable[[Rows], NDArray[Any]]:
        said = summary or (function.__doc__ or name).strip().splitlines()[0]
        SENSED.register(name, Observable(lambda _: box, compute=function), said)
        return function

    return register


def computed(settings: ExplorationSettings) -> dict[str, Observable]:
    """Return the observables that settings choose and that are functions, by name."""
    chosen = {name: SENSED[name] for name in settings.observe if name in SENSED}
    return {name: each for name, each in chosen.items() if each.compute is not None}


class ComputedObservations:
    """Computes the observables that settings choose and that are functions.

    Parameters
    ----------
    rows : Rows
        Input of the functions.

    Attributes
    ----------
    boxes : dict
        The space of each.
    """

    def __init__(self, rows: Rows) -> None:
        self._rows, self._count = rows, rows.robots * rows.episodes
        self._observables = computed(rows.settings)
        self.boxes = {name: each.box(rows.settings) for name, each in self._observables.items()}

    def write(self, out: Mapping[str, NDArray[Any]], seen: NDArray[np.bool_] | None = None) -> None:
        """Write the observables of rows, all or those that are seen."""
        for name, each in self._observables.items():
            box, compute = self.boxes[name], each.compute
            assert compute is not None
            values = np.asarray(compute(self._rows))
            if values.shape != (self._count, *box.shape):
                raise ValueError(
                    f"observable {name!r} has shape {values.shape}; want {(self._count, *box.shape)}: "
                    "a value for each row = episode * robots + robot"
                )
            if np.isnan(values).any():
                check_finite("observable", name, np.where(np.isinf(values), 0.0, values), self._rows)
            clipped = np.clip(values, box.low, box.high)
            if seen is None:
                out[name][:] = clipped
            else:
                out[name][seen] = clipped[seen]

    def buffers(self) -> dict[str, NDArray[Any]]:
        """Return new arrays for the observables, by name."""
        return {name: np.zeros((self._count, *box.shape), box.dtype) for name, box in self.boxes.items()}
