"""A Gymnasium environment of decisions: each step chooses if one robot of a team sets out.

The robots of a team are asked in turn; all share the rewards. The reward is the gain over classic tours: of
the time that those take, the share that they needed for what was newly seen, minus the share that it took.
They add up to 1 less the time over that of classic tours.
"""

from collections.abc import Callable
from dataclasses import fields, replace
from typing import Any, SupportsFloat

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from lidarium.agents.learned.decision import CROP_SIDE, MAX_DETOUR, Decision
from lidarium.agents.learned.features import MOST, OPTION_FEATURES, SITUATION_FEATURES, TEAMMATE_FEATURES
from lidarium.training.decisions import MOST_OPTIONS, MOST_TEAMMATES, Decisions, stacked
from lidarium.training.places import Place
from lidarium.training.reinforcement.choices import Asked, AskedEpisode, Pace, classic_pace

Observation = dict[str, NDArray[Any]]

EPISODES_PER_FLOOR = 4
"""So many episodes follow each other on the same floor, from the same starts."""

SLOWEST, SLOWEST_S = 2.0, 20.0
"""Episodes are truncated at the first times the time of classic tours, plus the second [s]."""


class ChoiceEnv(gymnasium.Env[Observation, np.int64]):
    """Chooses the first legs of tours, one robot after the other.

    An observation is a row of ``Decisions``; an action is the number of an option.
    """

    metadata = {"render_modes": []}  # noqa: RUF012

    def __init__(self, places: Callable[[int], Place], first: int = 0, step: int = 1) -> None:
        self._places, self._first, self._step = places, first, step
        self._number, self._left = first, 0
        self._place: Place | None = None
        self._pace: Pace | None = None
        self._episode: AskedEpisode | None = None
        self._asked = Asked(None, 0.0, 0.0)
        self.action_space = spaces.Discrete(MOST_OPTIONS)
        self.observation_space: spaces.Space[Observation] = spaces.Dict(boxes())  # type: ignore[assignment]

    def begin_at(self, number: int) -> None:
        """Let the next reset go to the place that is so far behind the first one."""
        self._number, self._left = self._first + number, 0

    def action_masks(self) -> NDArray[np.bool_]:
        """Return which options may be chosen, (MOST_OPTIONS,) bool."""
        mask = np.zeros(MOST_OPTIONS, np.bool_)
        if self._asked.decision is not None:
            mask[: len(self._asked.decision.mask)] = self._asked.decision.mask
        return mask

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start the next episode that has a decision."""
        super().reset(seed=seed, options=options)
        while True:
            self.close()
            self._episode = AskedEpisode(self._next_place())
            self._asked = self._episode.ask()
            if self._asked.decision is not None:
                return _row(self._asked.decision), {}
            self._episode, self._left = None, 0

    def _next_place(self) -> Place:
        """Return where the next episode takes place."""
        while self._place is None or self._left == 0:
            place = self._places(self._number)
            self._number += self._step
            self._pace = classic_pace(place)
            if self._pace is not None:
                horizon = SLOWEST * self._pace.time_s + SLOWEST_S
                self._place = replace(place, settings=replace(place.settings, horizon_s=horizon))
                self._left = EPISODES_PER_FLOOR
        self._left -= 1
        return self._place

    def step(self, action: np.int64) -> tuple[Observation, SupportsFloat, bool, bool, dict[str, Any]]:
        """Let the robot that was asked for set out, and go on to the next decision."""
        before = self._asked
        if self._episode is None or before.decision is None or self._pace is None:
            raise ValueError("there is no episode to go on with; call reset() first")
        if not (0 <= int(action) < len(before.decision.mask) and before.decision.mask[int(action)]):
            allowed = np.flatnonzero(before.decision.mask).tolist()
            raise ValueError(f"action {int(action)} is not on offer; want one of {allowed}")
        self._episode.answer(int(action))
        self._asked = self._episode.ask()
        gained = self._pace.left(before.coverage) - self._pace.left(self._asked.coverage)
        reward = gained - (self._asked.time_s - before.time_s) / self._pace.time_s
        if self._asked.decision is not None:
            return _row(self._asked.decision), reward, False, False, {}
        self._episode = None
        info = {"ratio": self._asked.time_s / self._pace.time_s, "coverage": self._asked.coverage}
        is_cut = self._asked.is_cut
        return _row(before.decision), reward, not is_cut, is_cut, info

    def close(self) -> None:
        """End the episode that runs."""
        if self._episode is not None:
            self._episode.abandon()
            self._episode = None


def boxes() -> dict[str, spaces.Space[Any]]:
    """Return the space of each array of a row of ``Decisions``."""
    numbers = {
        "options": (MOST_OPTIONS, len(OPTION_FEATURES)),
        "teammates": (MOST_TEAMMATES, len(TEAMMATE_FEATURES)),
        "situation": (len(SITUATION_FEATURES),),
    }
    most = np.array([MOST_OPTIONS, MOST_TEAMMATES])
    return {
        **{name: spaces.Box(-MOST, MOST, shape, np.float32) for name, shape in numbers.items()},
        "crops": spaces.Box(-1, 1, (MOST_OPTIONS, CROP_SIDE, CROP_SIDE), np.int8),
        "scores": spaces.Box(-MAX_DETOUR, 0.0, (MOST_OPTIONS,), np.float32),
        "mask": spaces.Box(0, 1, (MOST_OPTIONS,), np.bool_),
        "counts": spaces.Box(np.zeros(2, np.int64), most, dtype=np.int64),
    }


def _row(decision: Decision) -> Observation:
    table = stacked([decision])
    return {field.name: getattr(table, field.name)[0] for field in fields(Decisions)}
