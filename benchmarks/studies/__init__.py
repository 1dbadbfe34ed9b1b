"""Published results that one command makes anew: suites of episodes, or work of their own, and the page that tells of them."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from lidarium.benchmarks.studies.leaderboard import study as leaderboard
from lidarium.benchmarks.studies.merging import study as merging
from lidarium.benchmarks.studies.srt import study as srt
from lidarium.benchmarks.studies.supervisor import study as supervisor
from lidarium.evaluation.suites.suite import Suite


def no_suites(_data: Path | None, _every: int) -> dict[str, Suite]:
    """Return no suites: the experiment has work of its own."""
    return {}


@dataclass(frozen=True, slots=True)
class Experiment:
    """What ``lidarium reproduce NAME`` makes.

    Attributes
    ----------
    about : str
        One line for people.
    page : callable
        Takes the folder that the suites have run into, a folder for each by its name, and returns the page
        for ``docs/results``.
    suites : callable
        Takes the folder of real data (or None) and the share of the floors that is run, every how many-th;
        returns suites by name.
    work : callable or None
        What is done beside suites: takes the folder, that of real data (or None), every how many-th floor and
        the number of processes, and yields what is being done, how much of it is, and of how much. What the
        folder has is not done again.
    pictures : callable or None
        Takes the folder and that of the page, and draws the page's pictures.
    """

    about: str
    page: Callable[[Path, str], str]
    suites: Callable[[Path | None, int], dict[str, Suite]] = no_suites
    work: Callable[[Path, Path | None, int, int], Iterator[tuple[str, int, int]]] | None = None
    pictures: Callable[[Path, Path], None] | None = None


EXPERIMENTS: dict[str, Experiment] = {
    "leaderboard": Experiment(
        "all policies on generated and real floors, 1 to 3 robots, known starts",
        leaderboard.page,
        leaderboard.suites,
    ),
    "merging": Experiment(
        "map merging on a bank of maps that robots made, beside the thesis and ROS map_merge",
        merging.page,
        work=merging.work,
        pictures=merging.pictures,
    ),
    "srt": Experiment(
        "the sensor-based random tree towards goals in both modes, full exploration, and ablations of localization on curves",
        srt.page,
        srt.suites,
        srt.work,
        srt.pictures,
    ),
    "supervisor": Experiment(
        "teams with unknown starts under the supervisor, beside robots alone and teams that are told their starts",
        supervisor.page,
        supervisor.suites,
        work=supervisor.work,
    ),
}
"""By name; the page of one is ``docs/results/NAME.md``."""
