"""An episode whose decisions are asked for one by one.

The episode runs in a thread of its own and waits for each answer: policies call, and need not be turned
inside out. Only one of the two threads runs at a time.
"""

import threading
from dataclasses import dataclass
from queue import SimpleQueue

import numpy as np
from numpy.typing import NDArray

from lidarium.agents.learned.decision import Decision
from lidarium.agents.learned.policy import ChosenTours
from lidarium.agents.tours.policy import TourFrontier
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.evaluation.episodes.runner import run_episode
from lidarium.evaluation.suites.starts import drawn_starts
from lidarium.training.places import Place


@dataclass(frozen=True, slots=True)
class Asked:
    """A decision that is asked for.

    Attributes
    ----------
    decision : Decision or None
        None if the episode has ended.
    time_s : float
        Time since its start [s].
    coverage : float
        Share of the floor that is seen.
    is_cut : bool
        Whether the horizon has ended the episode.
    """

    decision: Decision | None
    time_s: float
    coverage: float
    is_cut: bool = False


@dataclass(frozen=True, slots=True)
class Pace:
    """How fast classic tours explore a floor.

    Attributes
    ----------
    coverages, times : (n,) float64
        Shares that were seen, increasing, and when first [s].
    """

    coverages: NDArray[np.float64]
    times: NDArray[np.float64]

    @property
    def time_s(self) -> float:
        """When enough was seen [s]."""
        return float(self.times[-1])

    def left(self, coverage: float) -> float:
        """Return the share of their time that classic tours need beyond a coverage."""
        return 1.0 - float(np.interp(coverage, self.coverages, self.times)) / self.time_s


def classic_pace(place: Place) -> Pace | None:
    """Return how fast classic tours explore.

    None if they do not see enough, or all at once.
    """
    env = ExplorationEnv(place.floor, place.settings)
    course: list[tuple[float, float]] = []
    starts = drawn_starts(place.floor, place.settings, place.seed)
    options = None if starts is None else {"starts": starts}
    run_episode(
        TourFrontier(),
        env,
        place.seed,
        options,
        lambda env: course.append((env.scorer.coverage, env.scorer.time)),
    )
    coverages, times = np.array(course).T
    first = np.unique(coverages, return_index=True)[1]
    wanted = place.settings.stop_coverage
    if len(first) < 2 or wanted is None or coverages[-1] < wanted - 1e-9:
        return None
    return Pace(coverages[first], times[first])


class _AbandonedError(Exception):
    """Ends the thread of an episode that was abandoned."""


class AskedEpisode:
    """An episode that asks for each decision."""

    def __init__(self, place: Place) -> None:
        self._questions: SimpleQueue[Asked | BaseException] = SimpleQueue()
        self._answers: SimpleQueue[int | None] = SimpleQueue()
        self._env = ExplorationEnv(place.floor, place.settings)
        self._thread = threading.Thread(target=self._run, args=(place,), daemon=True)
        self._thread.start()

    def ask(self) -> Asked:
        """Return the decision that is asked for next; the last one was answered."""
        asked = self._questions.get()
        if isinstance(asked, BaseException):
            raise asked
        return asked

    def answer(self, option: int) -> None:
        """Choose an option."""
        self._answers.put(option)

    def abandon(self) -> None:
        """End the episode before its end."""
        self._answers.put(None)
        self._thread.join()

    def _run(self, place: Place) -> None:
        try:
            starts = drawn_starts(place.floor, place.settings, place.seed)
            options = None if starts is None else {"starts": starts}
            run_episode(ChosenTours(self._choose, place.predictor), self._env, place.seed, options)
            self._questions.put(self._asked(None))
        except _AbandonedError:
            pass
        except Exception as error:  # whatever it is, who asks gets it
            self._questions.put(error)

    def _choose(self, decision: Decision) -> int:
        self._questions.put(self._asked(decision))
        answer = self._answers.get()
        if answer is None:
            raise _AbandonedError
        return answer

    def _asked(self, decision: Decision | None) -> Asked:
        scorer = self._env.scorer
        is_cut = decision is None and "horizon" in scorer.ended_because.values()
        return Asked(decision, scorer.time, scorer.coverage, is_cut)
