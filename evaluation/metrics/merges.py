"""Correctness and accuracy of map merges.

References
----------
Tolerances of correct merges: those of m-explore's own test of its map merging (Hörner, m-explore, BSD), 1e-2 rad
and 2 cells.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lidarium.envs.faces.merged_maps import MergeEvent
from lidarium.mapping.geometry.rigid import Transform

ROTATION_TOLERANCE = 1e-2
"""Largest error of the rotation of a correct merge [rad]."""

TRANSLATION_TOLERANCE = 2.0
"""Largest error of the translation of a correct merge [cells]."""

WRONG_TRANSLATION, WRONG_ROTATION = 0.3, math.radians(3.0)
"""Errors beyond which a merge is wrong [m, rad].

A merge with a larger error places walls in free space of the team's map.
"""

LEAST_OVERLAP = 0.10
"""Share of the area that maps must have in common for a merge to be expected."""


def transform_error(found: ArrayLike, true: ArrayLike, at: tuple[float, float] = (0.0, 0.0)) -> tuple[float, float]:
    """Return the errors [m] and [rad] of a transform T for a true one T*.

    They are ``|T a - T* a|`` and ``|wrap(theta - theta*)|``, of a T that was found.

    Parameters
    ----------
    found, true : (3,) float64
        x, y, theta [m, m, rad].
    at : (x, y)
        a, the point at which translations are compared [m]: the centre of the area that the maps share, since
        at a far origin a small error of the rotation seems a large one of the translation.
    """
    points = []
    for x, y, theta in (np.asarray(found, np.float64), np.asarray(true, np.float64)):
        cosine, sine = math.cos(theta), math.sin(theta)
        points.append((cosine * at[0] - sine * at[1] + x, sine * at[0] + cosine * at[1] + y))
    turn = float(np.asarray(found, np.float64)[2] - np.asarray(true, np.float64)[2])
    return math.dist(*points), abs(math.remainder(turn, 2.0 * math.pi))


def is_correct(translation_error: float, rotation_error: float, resolution: float) -> bool:
    """Return whether a merge is correct.

    It is within ``ROTATION_TOLERANCE`` and ``TRANSLATION_TOLERANCE``.

    m-explore's test takes the tolerance of each axis alone; here it is that of the distance.
    """
    # A millionth of a cell, so that an error of exactly two cells is not lost to rounding.
    return rotation_error <= ROTATION_TOLERANCE and translation_error <= (TRANSLATION_TOLERANCE + 1e-6) * resolution


def _is_wrong(translation_error: float, rotation_error: float) -> bool:
    """Return whether a merge is wrong.

    It is beyond ``WRONG_TRANSLATION`` or ``WRONG_ROTATION``, with errors as of `transform_error` [m, rad].
    """
    return translation_error > WRONG_TRANSLATION or rotation_error > WRONG_ROTATION


@dataclass(frozen=True, slots=True, eq=False)
class Trajectories:
    """True and believed poses of robots.

    Attributes
    ----------
    agents : sequence of str
        The robots.
    times : (times,) float64
        When [s], in order.
    true, believed : (times, robots, 3) float64
        x, y, theta in the floor's frame, and in that of each robot's own map [m, m, rad].
    """

    agents: Sequence[str]
    times: NDArray[np.float64]
    true: NDArray[np.float64]
    believed: NDArray[np.float64]

    def floor_from_map(self, agent: str, at: ArrayLike, until_s: float) -> Transform:
        """Return how a robot's map lies on the floor around a point of it [m].

        It lies as the robot's poses did when the robot was nearest to there.
        """
        robot = list(self.agents).index(agent)
        known = max(int(np.searchsorted(self.times, until_s, side="right")), 1)
        nearest = int(np.argmin(np.linalg.norm(self.believed[:known, robot, :2] - np.asarray(at, np.float64), axis=1)))
        true, believed = (Transform(*poses[nearest, robot].tolist()) for poses in (self.true, self.believed))
        return true @ believed.inverse()


def drifted_truth(event: MergeEvent, trajectories: Trajectories) -> tuple[float, float, float]:
    """Return the true transform ``a_from_b`` of two robots' maps.

    It holds if they overlap.

    Maps drift: if two maps overlap, their transform differs from the one between their starts. A merger sees the maps
    alone.
    """
    at_a = Transform(*event.found).apply(event.at)
    floor_from_a = trajectories.floor_from_map(event.a, at_a, event.time_s)
    floor_from_b = trajectories.floor_from_map(event.b, event.at, event.time_s)
    true = floor_from_a.inverse() @ floor_from_b
    return true.x, true.y, true.theta


def merge_figures(
    events: Sequence[MergeEvent], resolution: float, trajectories: Trajectories | None = None
) -> dict[str, Any]:
    """Return the entry ``merges`` of ``result.json``."""
    accepted = np.ones(len(events), np.bool_)
    errors = [transform_error(one.found, one.true, one.at) for one in events]
    direct = [one for one in events if one.is_direct]
    here = [
        transform_error(one.found, one.true if trajectories is None else drifted_truth(one, trajectories), one.at)
        for one in direct
    ]
    correct = np.array([is_correct(*error, resolution) for error in errors], np.bool_)
    right = int(np.count_nonzero(correct))
    times = [one.time_s for one in events]
    return {
        "accepted": len(events),
        "correct": right,
        "false": len(events) - right,
        "off": sum(_is_wrong(*error) for error in errors),
        "worst_m": max((round(distance, 6) for distance, _ in errors), default=None),
        "worst_rad": max((round(angle, 6) for _, angle in errors), default=None),
        "wrong": sum(_is_wrong(*error) for error in here),
        "worst_here_m": max((round(distance, 6) for distance, _ in here), default=None),
        "worst_here_rad": max((round(angle, 6) for _, angle in here), default=None),
        "first_correct_s": first_correct_time(times, accepted, correct),
    }


def precision(accepted: NDArray[np.bool_], correct: NDArray[np.bool_]) -> float | None:
    """Return |accepted and correct| / |accepted| over the attempts.

    None if none was accepted.

    Parameters
    ----------
    accepted, correct : (attempts,) bool
        Which attempts were accepted, and which were correct.
    """
    total = int(np.count_nonzero(accepted))
    return int(np.count_nonzero(accepted & correct)) / total if total else None


def recall(accepted: NDArray[np.bool_], correct: NDArray[np.bool_], overlaps: ArrayLike) -> float | None:
    """Return |accepted and correct| / |attempts|; None without attempts.

    Attempts are those with maps that overlap by ``LEAST_OVERLAP`` or more.

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
    """Return when the first correct merge was accepted [s], None if none was.

    Parameters
    ----------
    accepted, correct : (attempts,) bool
        Which attempts were accepted, and which were correct.
    """
    return min(
        (float(time) for time, is_good in zip(times, accepted & correct, strict=True) if is_good),
        default=None,
    )
