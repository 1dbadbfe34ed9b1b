"""Reward terms in addition to those of the kernels, registered by users."""

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.observing.rows import Rows, check_finite
from lidarium.mapping.geometry.bounds import shown
from lidarium.registry import Registry


class _RewardTerm(Protocol):
    """A term that users add: an amount per robot, weighted by ``settings.reward.more[name]``."""

    def start(self, rows: Rows, episode: int) -> None:
        """Start an episode, after its robots were placed."""
        ...

    def amounts(self, rows: Rows) -> NDArray[np.float64]:
        """Return the amount of each robot since the last call, shape (rows,)."""
        ...


REWARD_TERMS: Registry[Callable[[], _RewardTerm]] = Registry("reward term")
"""Terms that ``settings.reward.more`` can weigh, by name: functions that make one."""


def _rows_of(rows: Rows, episode: int) -> slice:
    """Return the rows of an episode."""
    return slice(episode * rows.robots, (episode + 1) * rows.robots)


class _FunctionTerm:
    """A term that is a plain function of ``Rows``, and keeps nothing.

    Parameters
    ----------
    function : callable
        Takes ``Rows`` and returns the amount of each, (rows,).
    """

    def __init__(self, function: Callable[[Rows], NDArray[Any]]) -> None:
        self._function = function

    def start(self, rows: Rows, episode: int) -> None:
        """Start an episode."""

    def amounts(self, rows: Rows) -> NDArray[np.float64]:
        """Return the values of the function."""
        return self._function(rows)


def reward_term(
    name: str, summary: str = ""
) -> Callable[[Callable[[Rows], NDArray[Any]]], Callable[[Rows], NDArray[Any]]]:
    """Register a function as a term of the reward; ``reward.more`` then takes its name and weight.

    Parameters
    ----------
    name : str
        Name of the term.
    summary : str, optional
        One line that describes it; the first line of the function's docstring by default.

    Returns
    -------
    callable
        A decorator of a function that takes ``Rows`` and returns an amount for each row, (rows,).

    Raises
    ------
    ValueError
        If the name is taken.

    Examples
    --------
    >>> import lidarium
    >>> @lidarium.reward_term("fast", "1 if the robot drives faster than 0.3 m/s")
    ... def fast(rows):
    ...     return rows.true_velocity[:, 0] > 0.3
    >>> env = lidarium.parallel_env(reward={"more": {"fast": 0.01}})
    """

    def register(function: Callable[[Rows], NDArray[Any]]) -> Callable[[Rows], NDArray[Any]]:
        said = summary or (function.__doc__ or name).strip().splitlines()[0]
        REWARD_TERMS.register(name, lambda: _FunctionTerm(function), said)
        return function

    return register


class _Turning:
    """Amount: by how much a robot has turned [rad]."""

    def __init__(self) -> None:
        self._headings = np.zeros(0)

    def start(self, rows: Rows, episode: int) -> None:
        """Start an episode at the headings of the starts."""
        if self._headings.shape != (len(rows.poses),):
            self._headings = np.zeros(len(rows.poses))
        own = _rows_of(rows, episode)
        self._headings[own] = rows.poses[own, 2]

    def amounts(self, rows: Rows) -> NDArray[np.float64]:
        """Return the turns since the last call, each in [0, pi] [rad]."""
        turns = np.abs((rows.poses[:, 2] - self._headings + np.pi) % (2.0 * np.pi) - np.pi)
        self._headings = rows.poses[:, 2].copy()
        return np.asarray(turns)


class _Failing:
    """Amount: 1 when a robot fails."""

    def __init__(self) -> None:
        self._failed = np.zeros(0, np.bool_)

    def start(self, rows: Rows, episode: int) -> None:
        """Start an episode in which no robot has failed."""
        if self._failed.shape != rows.failed.shape:
            self._failed = np.zeros_like(rows.failed)
        self._failed[_rows_of(rows, episode)] = 0

    def amounts(self, rows: Rows) -> NDArray[np.float64]:
        """Return 1 for each robot that has failed since the last call."""
        fell = rows.failed & ~self._failed
        self._failed = rows.failed
        return np.asarray(fell, np.float64)


class _FloorShare:
    """Amount: the robot's part of the area newly seen by the team, as a share of F; at most 1 over an episode.

    Area of the first scans is not rewarded. Robots get equal parts.
    """

    def __init__(self) -> None:
        self._coverage = np.zeros(0)

    def start(self, rows: Rows, episode: int) -> None:
        """Start an episode at the current coverage."""
        if self._coverage.shape != rows.live.shape:
            self._coverage = np.zeros(len(rows.live))
        own = _rows_of(rows, episode)
        self._coverage[own] = rows.coverage[own]

    def amounts(self, rows: Rows) -> NDArray[np.float64]:
        """Return the increase since the last call, over the number of robots."""
        gained, self._coverage = rows.coverage - self._coverage, rows.coverage
        return np.asarray(gained / rows.robots)


class _Completion:
    """Amount: 1 for each robot when the team has covered its floor."""

    def __init__(self) -> None:
        self._is_paid = np.zeros(0, np.bool_)

    def start(self, rows: Rows, episode: int) -> None:
        """Start an episode that is not complete."""
        if self._is_paid.shape != rows.live.shape:
            self._is_paid = np.zeros(len(rows.live), np.bool_)
        self._is_paid[_rows_of(rows, episode)] = False

    def amounts(self, rows: Rows) -> NDArray[np.float64]:
        """Return 1 if it has been completed since the last call."""
        is_complete = rows.is_covered & (rows.time_s > 0.0)
        paid = is_complete & ~self._is_paid
        self._is_paid |= is_complete
        return np.asarray(paid, np.float64)


class _FirstView:
    """Amount: the area of F that the robot's first scan has seen [m2], in the first step."""

    def __init__(self) -> None:
        self._seen = np.zeros(0)

    def start(self, rows: Rows, episode: int) -> None:
        """Start an episode."""
        if self._seen.shape != rows.live.shape:
            self._seen = np.zeros(len(rows.live))
        own = _rows_of(rows, episode)
        self._seen[own] = rows.seen_m2[own]

    def amounts(self, rows: Rows) -> NDArray[np.float64]:
        """Return the area seen before the first step, once."""
        begins = rows.time_s <= 0.0
        paid = np.where(begins, 0.0, self._seen)
        self._seen = np.where(begins, rows.seen_m2, 0.0)
        return paid


REWARD_TERMS.register("turning", _Turning, "radians turned since the last reward")
REWARD_TERMS.register("failing", _Failing, "1 when a robot fails")
REWARD_TERMS.register("floor_share", _FloorShare, "share of F seen anew, in equal parts; 1 over an episode")
REWARD_TERMS.register("completion", _Completion, "1 when the floor is covered")
REWARD_TERMS.register("first_view", _FirstView, "area that the first scan sees [m2], in the first step")


class ExtraTerms:
    """The registered terms that settings weigh.

    Parameters
    ----------
    weights : tuple of (str, float)
        ``settings.reward.more``.
    rows : Rows
        Input of the terms.
    """

    def __init__(self, weights: tuple[tuple[str, float], ...], rows: Rows) -> None:
        self._rows = rows
        self._terms = {name: (weight, REWARD_TERMS[name]()) for name, weight in weights}

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the terms."""
        return tuple(self._terms)

    @property
    def is_empty(self) -> bool:
        """Whether nothing is added."""
        return not self._terms

    def start(self, episode: int) -> None:
        """Start an episode, after its robots were placed."""
        for _, term in self._terms.values():
            term.start(self._rows, episode)

    def earned(self) -> dict[str, NDArray[np.float64]]:
        """Return the amount of each term for each robot since the last call, by name, (rows,) each.

        Raises
        ------
        ValueError
            If amounts are not a finite number for each row.
        """
        earned = {
            name: weight * self._checked(name, term.amounts(self._rows)) for name, (weight, term) in self._terms.items()
        }
        for name, amounts in earned.items():
            check_finite("reward term", name, amounts, self._rows)
        return earned

    def _checked(self, name: str, amounts: Any) -> NDArray[np.float64]:  # noqa: ANN401
        """Return what a term has returned as an array of a number for each row."""
        wanted = (self._rows.robots * self._rows.episodes,)
        try:
            numbers = np.asarray(amounts, np.float64)
        except (TypeError, ValueError) as error:
            raise ValueError(f"the reward term {name!r} is {shown(amounts)}; want numbers of shape {wanted}") from error
        if numbers.shape != wanted:
            raise ValueError(
                f"the reward term {name!r} has shape {numbers.shape}; want {wanted}: a number for each row = "
                "episode * robots + robot"
            )
        return numbers
