"""Published results that one command makes anew: suites and tables on top of the campaign and the report, nothing else."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from lidarium.evaluation.experiments import leaderboard
from lidarium.evaluation.suite import Suite


@dataclass(frozen=True, slots=True)
class Experiment:
    """What ``lidarium reproduce NAME`` makes.

    Attributes
    ----------
    about : str
        One line for people.
    suites : callable
        Takes the folder of real data (or None) and the share of the floors that is run, every how many-th; returns suites by name.
    page : callable
        Takes the folder that the suites have run into, a folder for each by its name, and returns the page for ``docs/results``.
    """

    about: str
    suites: Callable[[Path | None, int], dict[str, Suite]]
    page: Callable[[Path, str], str]


EXPERIMENTS: dict[str, Experiment] = {
    "leaderboard": Experiment(
        "all policies on generated and real floors, 1 to 3 robots, known starts", leaderboard.suites, leaderboard.page
    )
}
"""By name; the page of one is ``docs/results/NAME.md``."""
