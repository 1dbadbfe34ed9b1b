"""What a study is: work that one command does, with the page that reports it."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from lidarium.evaluation.suites.suite import Suite


def no_suites(_data: Path | None, _every: int) -> dict[str, Suite]:
    """Return no suites: the experiment has work of its own."""
    return {}


@dataclass(frozen=True, slots=True)
class Study:
    """What ``lidarium reproduce NAME`` makes.

    Attributes
    ----------
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

    page: Callable[[Path, str], str]
    suites: Callable[[Path | None, int], dict[str, Suite]] = no_suites
    work: Callable[[Path, Path | None, int, int], Iterator[tuple[str, int, int]]] | None = None
    pictures: Callable[[Path, Path], None] | None = None
