"""`lidarium reproduce`: run a published study again, and write its results page."""

import os
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from tyro.conf import Positional

from lidarium.extras import check_installed
from lidarium.scripts.common import DEFECT, INTERRUPTED, Answer, Command, counted, notify

if TYPE_CHECKING:
    from lidarium.evaluation.suites.campaign import Campaign

DEFAULT_FOLDER = Path("docs/results")
SECONDS_BETWEEN_LINES = 10.0
PART = "A part of the floors, seeds and other parts of the study ran: intervals are wide."


@dataclass(frozen=True, kw_only=True)
class Reproduce(Command):
    """Run the study of a page of docs/results, and write the page to --out.

    Finished parts are not run again. Conclusion and notes of a page stay as they are.
    """

    compiles: ClassVar[bool] = True

    name: Positional[str]
    """which study; `lidarium show studies` lists them"""
    data: Path | None = None
    """folder of real floors and laser logs; without it generated floors alone"""
    every: int = 1
    """of each kind of floor, or of other parts of a study, every N-th, for a shorter run"""
    share: float | None = None
    """the same as a share: 0.1 is --every 10"""
    quick: bool = False
    """a small part, in at most five minutes on two cores"""
    runs: Path = Path("runs/reproduce")
    """folder for episodes and other work"""
    parts: Path | None = None
    """archive of finished parts, such as those in docs/results/parts: read at the start, updated at the end"""
    workers: int = 0
    """processes that run episodes; 0 for as many as there are cores; timed parts run in one"""
    records: bool = False
    """keep a record of every episode"""


def execute(command: Reproduce) -> Answer:
    """Run the missing parts, then write the page."""
    from lidarium.benchmarks.results_page import about, publish
    from lidarium.benchmarks.studies import STUDIES
    from lidarium.benchmarks.studies.shared.archive import pack_parts, unpack_parts
    from lidarium.evaluation.suites.campaign import Campaign
    from lidarium.mapping.files.output import check_writable

    if command.every < 1 or command.workers < 0:
        raise ValueError(f"--every is {command.every} and --workers {command.workers}; want at least 1, and at least 0")
    out = command.out or DEFAULT_FOLDER
    study = STUDIES[command.name]
    every = _every(command, study.quick)
    for extra, packages in study.needs.items():
        check_installed(f"the study {command.name}", packages, extra)
    check_writable(out)
    folder = command.runs / command.name
    if command.parts is not None:
        check_writable(command.parts.parent)
        unpack_parts(command.parts, folder)
    workers = command.workers or len(os.sched_getaffinity(0))
    campaigns = {
        name: Campaign(suite, folder / name, workers, command.records)
        for name, suite in study.suites(command.data, every).items()
    }
    try:
        is_whole = all(_ran(campaign, name, command.json) for name, campaign in campaigns.items())
        if is_whole and study.work is not None:
            is_whole = _worked(study.work(folder, command.data, every, workers), command.json)
    finally:
        if command.parts is not None and folder.is_dir():
            pack_parts(folder, command.parts)
    if not is_whole:
        return Answer(_progress_of(campaigns), "interrupted; the same command goes on", INTERRUPTED)
    if study.pictures is not None:
        study.pictures(folder, out)
    failures = [(trial, error) for campaign in campaigns.values() for trial, error in campaign.failures]
    for trial, error in failures:
        notify(f"{trial.key}: {type(error).__name__}: {error}")
    page = out / f"{command.name}.md"
    words = publish(page, study.page(folder), about(_command_line(command)), PART if every > 1 else "")
    return Answer({**_progress_of(campaigns), "page": str(page)}, words, DEFECT if failures else 0)


def _every(command: Reproduce, quick: int) -> int:
    """Return every how many-th part is run."""
    if (command.share is not None) + (command.every != 1) + command.quick > 1:
        raise ValueError(
            f"--share is {command.share}, --every {command.every} and --quick {command.quick}; want one of them"
        )
    if command.quick:
        return quick
    if command.share is None:
        return command.every
    if not 0.0 < command.share <= 1.0:
        raise ValueError(f"--share is {command.share}; want a share above 0, up to 1")
    return max(round(1.0 / command.share), 1)


def _ran(campaign: "Campaign", name: str, is_quiet: bool) -> bool:
    """Run a campaign; False if the user broke it off."""
    runs = campaign.run()
    total = sum(1 for _ in campaign.suite.trials())
    try:
        for _ in counted(runs, total, f"{name} episodes", is_quiet, done=lambda: campaign.done):
            pass
    except KeyboardInterrupt:
        return False
    finally:
        runs.close()
    return True


def _worked(work: Iterator[tuple[str, int, int]], is_quiet: bool) -> bool:
    """Do an experiment's own work, and show its progress now and then.

    False if the user broke it off.
    """
    before, shown_at = "", 0.0
    try:
        for what, done, total in work:
            if not is_quiet and (what != before or time.monotonic() - shown_at > SECONDS_BETWEEN_LINES):
                notify(f"{what}: {done} of {total}" if total > done else f"{what}: {done}")
                before, shown_at = what, time.monotonic()
    except KeyboardInterrupt:
        return False
    return True


def _progress_of(campaigns: dict[str, "Campaign"]) -> dict[str, Any]:
    parts = {
        name: {
            "episodes": campaign.total,
            "finished": campaign.done,
            "failed": [trial.key for trial, _ in campaign.failures],
        }
        for name, campaign in campaigns.items()
    }
    return {"suites": parts}


def _command_line(command: Reproduce) -> str:
    data = (
        "" if command.data is None else f" --data {command.data.name if command.data.is_absolute() else command.data}"
    )
    part = f" --every {command.every}" if command.every > 1 else ""
    if command.share is not None:
        part = f" --share {command.share:g}"
    if command.quick:
        part = " --quick"
    return f"lidarium reproduce {command.name}{data}{part}"
