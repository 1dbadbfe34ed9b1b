"""Observables of the package that are functions: time, coverage, teammates."""

import math

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from lidarium.envs.observing.rows import FARTHEST, Rows
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.settings.sensors.observables import Observable

OLDEST_S = 3600.0
"""Bound of the age of what is known of others [s]."""


def _share(settings: ExplorationSettings) -> spaces.Box:
    return spaces.Box(0.0, 1.0, (1,), np.float32)


def time_left(rows: Rows) -> NDArray[np.float64]:
    """Return the share of the horizon that is left; 1 where there is none."""
    horizon = rows.settings.horizon_steps
    if horizon is None:
        return np.ones((rows.robots * rows.episodes, 1))
    return np.asarray(1.0 - rows.time_s[:, None] / (horizon * rows.settings.time_step))


def coverage(rows: Rows) -> NDArray[np.float64]:
    """Return the true share of F that the team has seen."""
    return rows.coverage[:, None]


def teammates(rows: Rows) -> NDArray[np.float64]:
    """Return what each robot knows of the others, places from its own."""
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
