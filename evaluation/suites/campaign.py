"""Runs a suite into a folder, and keeps every finished episode at once.

An interrupted run continues after the last finished episode.

A folder holds ``suite.json`` (the request), ``episodes.jsonl`` (a line per finished episode) and
``records/`` (a record per episode). Episodes depend on their trial alone, never on the worker or on those
before, so that any number of workers leaves the same lines, though in another order.
"""

import json
import os
import sys
from collections.abc import Generator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from tqdm import tqdm

import lidarium
from lidarium.agents.catalogue import source_of
from lidarium.agents.policy import settings_for
from lidarium.envs.floors.catalogue.names import is_file_name, load_floor
from lidarium.evaluation.episodes.settings_identity import settings_sha256
from lidarium.evaluation.processes import shared_out
from lidarium.evaluation.suites.episodes_file import FAILURES_FILE, KEY, EpisodesFile, read_episodes, read_failures
from lidarium.evaluation.suites.suite import MOST_SUITE_BYTES, Suite, suite_of
from lidarium.evaluation.suites.trial import Trial
from lidarium.evaluation.suites.trial_run import RECORDS_FOLDER, RecordNotWrittenError, run_trial
from lidarium.mapping.files.guarded_reading import read_text, reason
from lidarium.mapping.files.named_files import hash_of, named_files
from lidarium.mapping.files.output import clear_unfinished, write_json
from lidarium.registry import IMPORTS_VARIABLE

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
        if self.suite.bounds:
            from lidarium.evaluation.bounds.tours import check_solver

            check_solver()
        trials = list(self.suite.trials() if self.trials is None else self.trials)
        self.total, self.failures = len(trials), []
        with EpisodesFile(self.folder / EPISODES_FILE) as file:
            inputs = _inputs_of(self.suite)
            _check_same(file.episodes, self.suite, self.folder)
            _check_same_inputs(self.folder, inputs)
            _check_same_setups(file.episodes, self.suite, self.folder)
            failed = read_failures(self.folder)
            _write_suite(self.folder / SUITE_FILE, self.suite, inputs)
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
                    finished.add(trial.key)
                    self.done += 1
                    yield result
            file.check_in_place()
            found = {trial.key: f"{type(error).__name__}: {error}" for trial, error in self.failures}
            left = {key: why for key, why in (failed | found).items() if key not in finished}
            if left:
                write_json(self.folder / FAILURES_FILE, left)
            elif failed:
                (self.folder / FAILURES_FILE).unlink()

    def _work(
        self, missing: Sequence[Trial], records: Path | None
    ) -> Generator[tuple[Trial, dict[str, Any] | Exception], None, None]:
        """Return the work of trials, on this machine's processes or on a cluster."""
        if self.cluster is None:
            return shared_out(partial(run_trial, self.suite, records=records), missing, self.workers)
        from lidarium.evaluation.suites.on_ray import trials_on_ray

        return trials_on_ray(self.suite, missing, records, self.cluster)


class Rows(list[dict[str, Any]]):
    """Rows of episodes; notebooks show them as a table of policies."""


def evaluate(
    policies: str | Sequence[str],
    floors: str | Sequence[str] = "apartment",
    robots: int | Sequence[int] = 1,
    seeds: int | Sequence[int] = 3,
    *,
    out: Path | str | None = None,
    settings: Mapping[str, Any] | None = None,
    workers: int = 1,
    records: bool = False,
    bounds: bool = False,
    progress: bool = False,
) -> Rows:
    """Run policies on floors with teams and seeds, as the command ``lidarium evaluate`` does.

    Episodes of the same floor, team and seed have the same starts for every policy. Finished episodes are
    kept in the folder: an interrupted call continues if it is repeated.

    Parameters
    ----------
    policies : str or sequence of str
        Names of policies (``lidarium show policies``), or ``module:Class`` of your own.
    floors : str or sequence of str, optional
        Floors as for `load_floor`, or ``set:NAME`` for a set; "apartment" by default.
    robots : int or sequence of int, optional
        Numbers of robots; 1 by default.
    seeds : int or sequence of int, optional
        Number of seeds from 0 on, or the seeds; 3 by default.
    out : Path or str, optional
        Folder of the episodes, for ``lidarium report``. By default nothing is kept.
    settings : mapping, optional
        Options as for `parallel_env`. By default ``horizon_s`` is 1800 and ``stop_coverage`` 0.99.
    workers : int, optional
        Number of processes, 1 by default. Processes know policies that are registered in an installed
        module or in one that ``LIDARIUM_IMPORT`` names. They load the calling program: with more than 1 the
        call has to be below ``if __name__ == "__main__":``.
    records : bool, optional
        Whether a record of every episode is written, for replays; False by default.
    bounds : bool, optional
        Whether each episode is compared with the bound of a team that has the floor plan; False by default.
        Needs the extra ``bounds``.
    progress : bool, optional
        Whether a progress bar is shown, in notebooks too as text; False by default.

    Returns
    -------
    list of dict
        A row per episode in the order of the request, with ``policy``, ``floor``, ``robots``, ``seed`` and
        all metrics, such as ``t99_s`` [s].

    Raises
    ------
    ValueError
        If a name or a number is unknown, or the folder holds episodes of other settings.
    RuntimeError
        If an episode failed, or the program starts processes while they load it.

    Examples
    --------
    >>> import lidarium
    >>> rows = lidarium.evaluate("nearest_frontier", robots=2, seeds=1, settings={"horizon_s": 5.0})
    >>> rows[0]["policy"], rows[0]["time_s"]
    ('nearest_frontier', 5.0)
    """
    suite = suite_of(
        {
            "policies": policies,
            "floors": floors,
            "robots": robots,
            "seeds": seeds,
            "settings": {"horizon_s": 1800.0, "stop_coverage": 0.99, **(settings or {})},
            "bounds": bounds,
        }
    )
    if out is None:
        with TemporaryDirectory(prefix="lidarium-") as folder:
            return _rows_of(Campaign(suite, Path(folder), workers, records), progress)
    return _rows_of(Campaign(suite, Path(out), workers, records), progress)


def _rows_of(campaign: Campaign, shows_progress: bool) -> Rows:
    """Run a campaign, and return its rows in the order of its trials."""
    total = sum(1 for _ in campaign.suite.trials())
    for _ in tqdm(campaign.run(), total=total, unit=" episodes", disable=not shows_progress):
        pass
    for trial, error in campaign.failures:
        message = f"{len(campaign.failures)} of {campaign.total} episodes failed, first {trial.key}: {error}"
        raise RuntimeError(message) from error
    rows = {row[KEY]: row for row in read_episodes(campaign.folder / EPISODES_FILE)}
    return Rows(rows[trial.key] for trial in campaign.suite.trials())


def _inputs_of(suite: Suite) -> dict[str, str]:
    """Return hashes of the files that a suite's results depend on, by what they are.

    They are floors in files, the modules of own policies, files that settings of policies and of the world name, such
    as weights, and modules that are imported for what they register.
    """
    found = {
        f"floor {floor!r}": load_floor(floor, suite.pixel_side(floor)).sha256
        for floor in suite.single_floors
        if is_file_name(floor)
    }
    for name in suite.policies:
        options = dict(suite.policy_settings.get(name, {}))
        source = source_of(options.pop("policy", name))
        files = [*([] if source is None else [source]), *named_files(options)]
        if files:
            found[f"policy {name!r}"] = hash_of(files)
    for name, options in suite.as_dict()["variants"].items():
        if files := named_files(options):
            found[f"settings {name!r}"] = hash_of(files)
    for module in filter(None, os.environ.get(IMPORTS_VARIABLE, "").split(",")):
        file = getattr(sys.modules.get(module.strip()), "__file__", None)
        if file is not None:
            found[f"module {module.strip()!r}"] = hash_of([Path(file)])
    return found


def _check_same_inputs(folder: Path, inputs: Mapping[str, str]) -> None:
    """Check that files that earlier episodes depend on have not changed."""
    before = _kept_suite(folder / SUITE_FILE).get("inputs", {})
    for name, found in inputs.items():
        if before.get(name, found) != found:
            raise ValueError(
                f"{folder} holds episodes of {name} as it was before its file changed; results of both are not "
                "pooled, choose another folder"
            )


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
    asked, options = suite.as_dict(), kept.get("policy_settings", {})
    for name in suite.policies:
        if name in kept.get("policies", ()) and asked["policy_settings"].get(name, {}) != options.get(name, {}):
            raise ValueError(
                f"{folder} holds episodes of policy {name!r} with other settings, {options.get(name, {})}; choose "
                "another folder"
            )
    for name in ("draws_starts", "bounds", "image_resolution"):
        if kept.get(name, asked[name]) != asked[name]:
            raise ValueError(
                f"{folder} holds episodes of a suite with {name} = {kept[name]}, this one has {asked[name]}; choose "
                "another folder"
            )
    if kept and kept.get("stop") != suite.as_dict()["stop"]:
        raise ValueError(
            f"{folder} holds episodes that ended by the rule {kept.get('stop')}, this suite has "
            f"{suite.stop}; choose another folder"
        )
    for floor in suite.floors:
        if floor in kept.get("floors", ()) and asked["starts"].get(floor) != kept.get("starts", {}).get(floor):
            raise ValueError(f"{folder} holds episodes with other starts on {floor!r}; choose another folder")


def _check_same_setups(episodes: list[dict[str, Any]], suite: Suite, folder: Path) -> None:
    """Check that existing episodes are of the suite's settings, options of policies, stop rule and ways to start.

    Folders of joined episodes have no file of their suite.
    """
    worlds: dict[tuple[str, str, int], str] = {}
    for episode in episodes:
        policy, variant, robots = episode["policy"], episode["variant"], episode["robots"]
        if not (policy in suite.policies and variant in suite.variants):
            continue
        setup = suite.setup_sha256(policy, variant)
        if episode.get("setup_sha256", setup) != setup:
            raise ValueError(
                f"{folder} holds episodes of {policy} with other options, rules to stop or ways to start; choose "
                "another folder"
            )
        if robots in suite.robots:
            asked = policy, variant, robots
            if asked not in worlds:
                settings = settings_for(suite.make_policy(policy), suite.settings(variant, robots))
                worlds[asked] = settings_sha256(settings)
            if episode.get("settings_sha256", worlds[asked]) != worlds[asked]:
                raise ValueError(
                    f"{folder} holds episodes of {policy} in variant {variant!r} with other settings; choose another "
                    "folder"
                )


def _check_same_options(folder: Path, variant: str, kept: Mapping[str, Any], asked: Mapping[str, Any]) -> None:
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
        raise ValueError(f"{path} is there, and no evaluation has written it; move it away, or choose another folder")
    return kept


def _write_suite(path: Path, suite: Suite, inputs: Mapping[str, str]) -> None:
    """Write the requests of this and of earlier calls."""
    kept, asked = _kept_suite(path), {**suite.as_dict(), "inputs": dict(inputs)}
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
