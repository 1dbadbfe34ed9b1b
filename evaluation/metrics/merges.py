"""Whether maps were merged where they should be, and how exactly.

References
----------
What is correct: the tolerances of m-explore's own test of its map merging (Hörner, m-explore, BSD), 1e-2 rad and 2 cells.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lidarium.envs.wrappers.merged_maps import MergeEvent

ROTATION_TOLERANCE = 1e-2
"""Largest error of the rotation of a correct merge [rad]."""

TRANSLATION_TOLERANCE = 2.0
"""Largest error of the translation of a correct merge [cells]."""

LEAST_OVERLAP = 0.10
"""Share of the area that maps must have in common for a merge to be expected."""


def transform_error(found: ArrayLike, true: ArrayLike, at: tuple[float, float] = (0.0, 0.0)) -> tuple[float, float]:
    """Return ``|T a - T* a|`` [m] and ``|wrap(theta - theta*)|`` [rad] of a transform T that was found for a true one T*.

    Parameters
    ----------
    found, true : (3,) float64
        x, y, theta [m, m, rad].
    at : (x, y)
        a, the point at which translations are compared [m]: the centre of what the maps have in common, since at a far origin a small
        error of the rotation looks like a large one of the translation.
    """
    points = []
    for x, y, theta in (np.asarray(found, np.float64), np.asarray(true, np.float64)):
        cosine, sine = math.cos(theta), math.sin(theta)
        points.append((cosine * at[0] - sine * at[1] + x, sine * at[0] + cosine * at[1] + y))
    turn = float(np.asarray(found, np.float64)[2] - np.asarray(true, np.float64)[2])
    return math.dist(*points), abs(math.remainder(turn, 2.0 * math.pi))


def is_correct(translation_error: float, rotation_error: float, resolution: float) -> bool:
    """Return whether a merge is correct: within ``ROTATION_TOLERANCE`` and ``TRANSLATION_TOLERANCE``.

    m-explore's test takes the tolerance of each axis alone; here it is that of the distance.

    Parameters
    ----------
    translation_error, rotation_error : float
        As of `transform_error` [m, rad].
    resolution : float
        Side of a cell of the maps [m].
    """
    # A millionth of a cell, so that an error of exactly two cells is not lost to rounding.
    return rotation_error <= ROTATION_TOLERANCE and translation_error <= (TRANSLATION_TOLERANCE + 1e-6) * resolution


def merge_figures(events: Sequence[MergeEvent], resolution: float) -> dict[str, Any]:
    """Return the entry ``merges`` of ``result.json``.

    Parameters
    ----------
    events : sequence of MergeEvent
        All of an episode.
    resolution : float
        Side of a cell of the maps [m].

    Returns
    -------
    dict
        ``accepted``, ``correct`` and ``false`` are numbers of events, ``first_correct_s`` is a time or None.
    """
    accepted = np.ones(len(events), np.bool_)
    correct = np.array([is_correct(*transform_error(one.found, one.true, one.at), resolution) for one in events], np.bool_)
    right = int(np.count_nonzero(correct))
    times = [one.time_s for one in events]
    return {
        "accepted": len(events),
        "correct": right,
        "false": len(events) - right,
        "first_correct_s": first_correct_time(times, accepted, correct),
    }


def precision(accepted: NDArray[np.bool_], correct: NDArray[np.bool_]) -> float | None:
    """Return |accepted and correct| / |accepted| over the attempts; None where none was accepted.

    Parameters
    ----------
    accepted, correct : (attempts,) bool
        Which attempts were accepted, and which were correct.
    """
    total = int(np.count_nonzero(accepted))
    return int(np.count_nonzero(accepted & correct)) / total if total else None


def recall(accepted: NDArray[np.bool_], correct: NDArray[np.bool_], overlaps: ArrayLike) -> float | None:
    """Return |accepted and correct| / |attempts| over those whose maps overlap by ``LEAST_OVERLAP`` or more; None without such.

    Parameters
    ----------
    accepted, correct : (attempts,) bool
        Which attempts were accepted, and which were correct.
    overlaps : (attempts,) float64
        Share of the area that the maps of each attempt have in common in truth.
    """
    expected = np.asarray(overlaps, np.float64) >= LEAST_OVERLAP
    total = int(np.count_nonzero(expected))
    return int(np.count_nonzero(accepted & correct & expected)) / total if total else None


def first_correct_time(times: Sequence[float], accepted: NDArray[np.bool_], correct: NDArray[np.bool_]) -> float | None:
    """Return when the first correct merge was accepted [s], None where none was.

    Parameters
    ----------
    times : sequence of float
        When each attempt was made, in any order [s].
    accepted, correct : (attempts,) bool
        Which attempts were accepted, and which were correct.
    """
    return min((float(time) for time, is_good in zip(times, accepted & correct, strict=True) if is_good), default=None)
