"""A teacher that knows the floor: episodes run again with one decision changed.

The world is deterministic. What another choice would have cost is found by making it, at the same place of
the same episode, and going on with the same policy to the end.

References
----------
D. Bertsekas, "Rollout, policy iteration, and distributed reinforcement learning", 2020.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from lidarium.agents.learned.decision import Chooser, Decision
from lidarium.agents.learned.policy import ChosenTours
from lidarium.envs.exploration import ExplorationEnv
from lidarium.evaluation.episodes.runner import run_episode
from lidarium.evaluation.suites.starts import drawn_starts
from lidarium.training.decisions import MOST_OPTIONS, stacked
from lidarium.training.places import Place
from lidarium.training.replays.samples import SHARES, Samples

PLAUSIBLE_M = 4.0
"""Options whose preference is lower by this are tried e times less often [m]."""

ROBOT_SECONDS = 6000.0
"""Replays of a floor simulate so many seconds of robots at most, but for the least number of replays [s]."""

LEAST_REPLAYS = 6
"""So often an episode is run again at least."""

GIVEN_UP = (1.5, 20.0)
"""A replay is given up at the first times the episode's time, plus the second [s]."""

Preferences = Callable[[Decision], NDArray[np.floating]]


@dataclass(slots=True)
class Recorder:
    """Chooses what is preferred most, and keeps what it decided.

    One decision may be forced.

    Attributes
    ----------
    preferences : callable
        Returns how much each option is preferred.
    forced : (int, int) or None
        Number of a decision, and what is chosen there.
    decisions, choices : list
        What was decided so far.
    """

    preferences: Preferences
    forced: tuple[int, int] | None = None
    decisions: list[Decision] = field(default_factory=list)
    choices: list[int] = field(default_factory=list)

    def __call__(self, decision: Decision) -> int:
        """Return the option to choose."""
        is_forced = self.forced is not None and self.forced[0] == len(self.choices)
        choice = self.forced[1] if is_forced and self.forced is not None else self._best(decision)
        self.decisions.append(decision)
        self.choices.append(choice)
        return choice

    def _best(self, decision: Decision) -> int:
        return int(np.argmax(np.where(decision.mask, self.preferences(decision), -np.inf)))


def classic_preferences(decision: Decision) -> NDArray[np.floating]:
    """Return the preferences of classic tours."""
    return decision.scores


def times_of(place: Place, choose: Chooser, horizon_s: float | None = None) -> NDArray[np.float64]:
    """Return when an episode has seen each of ``SHARES``, (4,) [s]; inf where it has not.

    Parameters
    ----------
    place : Place
        Where.
    choose : callable
        Chooses options.
    horizon_s : float or None
        When the episode is given up [s]; that of the settings where None.
    """
    settings = place.settings if horizon_s is None else replace(place.settings, horizon_s=horizon_s)
    env = ExplorationEnv(place.floor, settings)
    times = np.full(len(SHARES), np.inf)

    def note(env: ExplorationEnv) -> None:
        reached = env.scorer.coverage >= np.array(SHARES) - 1e-12
        times[reached & np.isinf(times)] = env.scorer.time

    starts = drawn_starts(place.floor, settings, place.seed)
    run_episode(ChosenTours(choose), env, place.seed, None if starts is None else {"starts": starts}, note)
    return times


def replays_of(place: Place, preferences: Preferences, count: int) -> Samples | None:
    """Return the samples of an episode and its replays, None where it does not see enough of the floor.

    Parameters
    ----------
    place : Place
        Where.
    preferences : callable
        What decides, in the episode and on from each change.
    count : int
        How many replays; fewer where they take long.
    """
    episode = Recorder(preferences)
    times = times_of(place, episode)
    if np.isinf(times[-1]):
        return None
    most = round(ROBOT_SECONDS / (times[-1] * place.settings.robots))
    pairs = _pairs(episode, min(count, max(most, LEAST_REPLAYS)), place)
    horizon = min(GIVEN_UP[0] * times[-1] + GIVEN_UP[1], place.settings.horizon_s or np.inf)
    replayed = [times_of(place, Recorder(preferences, pair), horizon) for pair in pairs]
    return Samples(
        stacked([episode.decisions[number] for number, _ in pairs]),
        np.array([episode.choices[number] for number, _ in pairs], np.int64),
        np.array([other for _, other in pairs], np.int64),
        np.tile(times, (len(pairs), 1)),
        np.array(replayed).reshape(-1, len(SHARES)),
    )


def _pairs(episode: Recorder, count: int, place: Place) -> list[tuple[int, int]]:
    """Return which decisions are changed, and to what: the likely options more often."""
    generator = np.random.default_rng([place.seed, 17])
    order = generator.permutation(len(episode.choices))
    left: list[tuple[int, NDArray[np.float64]]] = []
    for number in order:
        decision, choice = episode.decisions[number], episode.choices[number]
        preferences = np.asarray(episode.preferences(decision), np.float64)[:MOST_OPTIONS]
        likely = np.exp((preferences - preferences[decision.mask].max()) / PLAUSIBLE_M) * decision.mask
        likely[choice] = 0.0
        left.append((int(number), likely))
    pairs: list[tuple[int, int]] = []
    while left and len(pairs) < count:
        for number, likely in left[: count - len(pairs)]:
            if likely.sum() > 0.0:
                other = int(generator.choice(len(likely), p=likely / likely.sum()))
                likely[other] = 0.0
                pairs.append((number, other))
        left = [(number, likely) for number, likely in left if likely.sum() > 1e-9]
    return pairs
