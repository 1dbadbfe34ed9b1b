"""Runs a suite into a folder, and keeps every finished episode at once.

An interrupted run continues where it stopped.

A folder holds ``suite.json`` (the request), ``episodes.jsonl`` (a line per finished episode) and
``records/`` (a record per episode). Episodes depend on their trial alone, never on the worker or on those
before, so that any number of workers leaves the same lines, though in another order.
"""

import json
from collections.abc import Generator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import lidarium
from lidarium.evaluation.processes import shared_out
from lidarium.evaluation.suites.episodes_file import KEY, EpisodesFile
from lidarium.evaluation.suites.suite import MOST_SUITE_BYTES, Suite
from lidarium.evaluation.suites.trial import Trial
from lidarium.evaluation.suites.trial_run import RECORDS_FOLDER, RecordNotWrittenError, run_trial
from lidarium.mapping.files.guarded_reading import read_text, reason
from lidarium.mapping.files.output import clear_unfinished, write_json

if TYPE_CHECKING:
    pass

SUITE_FILE, EPISODES_FILE = "suite.json", "episodes.jsonl"


@dataclass(slots=True)
class Campaign:
    """A suite that runs into a folder.

    Attributes
    ----------
    failures : list of (Trial, Exception)
        Trials that came to no end, and why.
    done : int
        Episodes of the suite that are finished.
    total : int
        Episodes of the suite.
    """

    suite: Suite
    folder: Path
    workers: int = 1
    records: bool = True
    trials: Sequence[Trial] | None = None
    cluster: str | None = None
    failures: list[tuple[Trial, Exception]] = field(default_factory=list)
    done: int = 0
    total: int = 0

    def run(self) -> Generator[dict[str, Any], None, None]:
        """Run the missing parts, and yield each episode's line when it is on the disk."""
        if self.workers < 1:
            raise ValueError(f"workers is {self.workers}; want at least 1")
        trials = list(self.suite.trials() if self.trials is None else self.trials)
        self.total, self.failures = len(trials), []
        with EpisodesFile(self.folder / EPISODES_FILE) as file:
            _check_same(file.episodes, self.suite, self.folder)
            _write_suite(self.folder / SUITE_FILE, self.suite)
            records = self.folder / RECORDS_FOLDER if self.records else None
            clear_unfinished(self.folder / RECORDS_FOLDER, ".npz")
            finished = {episode[KEY] for episode in file.episodes}
            missing = [trial for trial in trials if trial.key not in finished]
            self.done = self.total - len(missing)
            with closing(self._work(missing, records)) as work:
                for trial, result in work:
                    if isinstance(result, RecordNotWrittenError):
                        raise result
                    if isinstance(result, Exception):
                        self.failures.append((trial, result))
                        continue
                    file.append(result)
                    self.done += 1
                    yield result
            file.check_in_place()

    def _work(
        self, missing: Sequence[Trial], records: Path | None
    ) -> Generator[tuple[Trial, dict[str, Any] | Exception], None, None]:
        """Return the work of trials, on this machine's processes or on a cluster."""
        if self.cluster is None:
            return shared_out(partial(run_trial, self.suite, records=records), missing, self.workers)
        from lidarium.evaluation.suites.on_ray import trials_on_ray

        return trials_on_ray(self.suite, missing, records, self.cluster)


def _check_same(episodes: list[dict[str, Any]], suite: Suite, folder: Path) -> None:
    """Check that existing episodes are of this version and the suite's settings."""
    for episode in episodes:
        if episode.get("version") != lidarium.__version__:
            raise ValueError(
                f"{folder} holds episodes of lidarium {episode.get('version')}, this is "
                f"{lidarium.__version__}; "
                "results of two versions are not compared, choose another folder"
            )
    kept = _kept_suite(folder / SUITE_FILE)
    for name, options in kept.get("variants", {}).items():
        if name in suite.variants:
            _check_same_options(folder, name, options, suite.as_dict()["variants"][name])
    for name, options in kept.get("policy_settings", {}).items():
        if name in suite.policies and suite.as_dict()["policy_settings"].get(name) != options:
            raise ValueError(
                f"{folder} holds episodes of policy {name!r} with other settings, {options}; choose another "
                "folder"
            )
    if kept and kept.get("stop") != suite.as_dict()["stop"]:
        raise ValueError(
            f"{folder} holds episodes that ended by the rule {kept.get('stop')}, this suite has "
            f"{suite.stop}; choose another folder"
        )
    for floor, teams in kept.get("starts", {}).items():
        if floor in suite.floors and suite.as_dict()["starts"].get(floor) != teams:
            raise ValueError(f"{folder} holds episodes with other starts on {floor!r}; choose another folder")


def _check_same_options(
    folder: Path, variant: str, kept: Mapping[str, Any], asked: Mapping[str, Any]
) -> None:
    for option in sorted({*kept, *asked}):
        before, now = kept.get(option, "its default"), asked.get(option, "its default")
        if before != now:
            raise ValueError(
                f"{folder} holds episodes of variant {variant!r} with {option} = {before}, this suite has "
                f"{option} = {now}; "
                "choose another folder, or another name for the variant"
            )


def _kept_suite(path: Path) -> dict[str, Any]:
    if not path.exists():
        return {}
    try:
        kept = json.loads(read_text(path, MOST_SUITE_BYTES))
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{path} is not JSON: {reason(error)}; mend it, or choose another folder") from error
    if not (isinstance(kept, dict) and "version" in kept and "policies" in kept):
        raise ValueError(
            f"{path} is there, and no evaluation has written it; move it away, or choose another folder"
        )
    return kept


def _write_suite(path: Path, suite: Suite) -> None:
    """Write the requests of this and of earlier calls."""
    kept, asked = _kept_suite(path), suite.as_dict()
    joined: dict[str, Any] = {"version": lidarium.__version__}
    for name, value in asked.items():
        before = kept.get(name)
        if isinstance(value, list):
            joined[name] = [*(before or []), *(each for each in value if each not in (before or []))]
        elif isinstance(value, dict):
            joined[name] = {**(before or {}), **value}
        else:
            joined[name] = value
    if joined != kept:
        write_json(path, joined)
