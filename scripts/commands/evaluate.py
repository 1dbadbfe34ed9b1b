"""`lidarium evaluate`: evaluate policies on floors, with teams, seeds and settings, into a folder."""

import os
import re
import statistics
from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from tyro.conf import Positional

from lidarium.mapping.geometry.bounds import shown
from lidarium.scripts.common import (
    DEFECT,
    DONE,
    DOUBTFUL,
    INTERRUPTED,
    Answer,
    TeamCommand,
    compile_first,
    counted,
    notify,
    table,
)
from lidarium.scripts.options import check_supervised, is_supervised, options_by_policy, supervisor_options

if TYPE_CHECKING:
    from lidarium.evaluation.suites.campaign import Campaign
    from lidarium.evaluation.suites.suite import Suite

DEFAULT_FOLDER = Path("runs/evaluation")


@dataclass(frozen=True, kw_only=True)
class _Evaluate(TeamCommand):
    """Run policies x floors x robots x seeds.

    Finished episodes are kept, and the same command continues after the last finished one.
    """

    compiles: ClassVar[bool] = True

    suite: Positional[Path | None] = None
    """TOML file with the suite, in place of the options below"""
    own_policies: bool = False
    """let the suite name policies as module:Class; their modules are imported and run"""
    preset: str | None = None
    """evaluate as another project does.

    Projects are explore-bench, ariadne, dare, chen, ir2, marvel, maexp, mapex or houseexpo. Settings, teams and
    stop rule are its own, and its floors, too, unless --floors names others.
    """
    data: Path | None = None
    """folder of real floors, for presets"""
    policies: tuple[str, ...] = ("nearest_frontier", "utility_frontier", "explore_lite")
    """policies to compare; `lidarium show policies` lists them; module:Class for your own"""
    policy_set: tuple[str, ...] = ()
    """settings of policies as POLICY.KEY=VALUE, such as learned.weights=FILE"""
    floors: tuple[str, ...] = ()
    """floors as for `lidarium run`, or folders of them; apartment by default.

    Set:NAME for all floors of a set, set:NAME:COUNT for its first ones
    """
    robots: tuple[int, ...] = (1, 2, 3)
    """sizes of teams"""
    seeds: int = 3
    """how many seeds, from --seed on.

    The same seed draws the same starts for every policy
    """
    horizon_s: float = 1800.0
    """simulated time after which an episode is cut [s]"""
    stop_coverage: float = 0.99
    """share of the floor at which an episode ends"""
    resolution: float | None = None
    """metres per pixel of those floors that are plain images"""
    workers: int = 0
    """processes that run episodes; 0 for as many as there are cores"""
    ray: str | None = None
    """Ray cluster that runs episodes in place of --workers: auto, or HOST:PORT (extra `ray`)"""
    shard: str | None = None
    """part of the episodes that runs, as K/N: the K-th of N, for machines that do not know each other"""
    bounds: bool = False
    """compare each episode with the time of a team that knows the floor (extra `bounds`)"""
    records: bool = True
    """keep a record of every episode, for replays and for the pictures of the report; the level graph has none"""


def execute(command: _Evaluate) -> Answer:
    """Run the missing episodes of a suite."""
    from lidarium.evaluation.suites.campaign import Campaign
    from lidarium.mapping.files.output import check_writable

    if command.workers < 0:
        raise ValueError(f"--workers is {command.workers}; want 0 for as many as there are cores, or more")
    folder = command.out or DEFAULT_FOLDER
    check_writable(folder)
    part = shard_of(command.shard)
    suite = _suite(command)
    campaign = Campaign(
        suite,
        folder,
        command.workers or len(os.sched_getaffinity(0)),
        command.records,
        list(suite.trials())[part],
        cluster=command.ray,
    )
    compile_first()
    is_interrupted = False
    runs = campaign.run()
    try:
        for _ in counted(runs, len(campaign.trials or ()), "episodes", command.json, done=lambda: campaign.done):
            pass
    except KeyboardInterrupt:
        is_interrupted = True
    finally:
        runs.close()
    return _answer(campaign, folder, is_interrupted)


def shard_of(text: str | None) -> slice:
    """Return which of the trials a shard has."""
    if text is None:
        return slice(None)
    found = re.fullmatch(r"(\d{1,6})/(\d{1,6})", text)
    shard, count = (int(found[1]), int(found[2])) if found else (0, 0)
    if not 1 <= shard <= count:
        raise ValueError(f"--shard is {text!r}; want K/N with K from 1 to N, such as 2/8")
    return slice(shard - 1, None, count)


def _suite(command: _Evaluate) -> "Suite":
    from lidarium.evaluation.suites.suite import Suite, read_suite
    from lidarium.evaluation.suites.trial import DEFAULT_VARIANT

    if command.suite is not None:
        _check_options(command, {"suite", "own_policies"}, "the suite")
        return read_suite(command.suite, command.own_policies)
    if command.preset is not None:
        taken = {"preset", "data", "policies", "floors", "seed", "seeds"}
        _check_options(command, taken, f"the preset {command.preset}")
    if command.seeds < 1:
        raise ValueError(f"--seeds is {command.seeds}; want at least 1")
    seeds = tuple(range(command.seed, command.seed + command.seeds))
    if command.preset is not None:
        from lidarium.evaluation.suites.presets import preset_suite

        return preset_suite(command.preset, command.policies, seeds, command.data, command.floors)
    settings = {
        **command.team_options,
        **command.run_options,
        "horizon_s": command.horizon_s,
        "stop_coverage": command.stop_coverage,
    }
    return Suite(
        policies=command.policies,
        floors=command.floors or ("apartment",),
        robots=command.robots,
        seeds=seeds,
        variants={DEFAULT_VARIANT: settings},
        bounds=command.bounds,
        image_resolution=command.resolution,
        policy_settings=_policy_settings(command),
    )


_OF_RUNS = {"out", "json", "workers", "ray", "shard", "records"}
"""Options that say how episodes are run, not which."""


def _check_options(command: _Evaluate, taken: Container[str], by: str) -> None:
    """Check that no option is given that a suite or a preset sets itself."""
    for each in fields(command):
        value = getattr(command, each.name)
        is_given = each.name in command.given or value != each.default
        if is_given and each.name not in {*_OF_RUNS, "given"} and each.name not in taken:
            option = f"--{each.name.replace('_', '-')}"
            raise ValueError(f"{option} is {shown(value)}, and {by} sets it; leave it out, or write your own suite")


def _policy_settings(command: _Evaluate) -> dict[str, dict[str, Any]]:
    """Return the settings of the policies."""
    given = options_by_policy(command.policy_set, command.policies)
    options = supervisor_options(command.supervisor)
    led = [name for name in command.policies if is_supervised(name)] if options else []
    if options and not led:
        check_supervised(command.policies[0])
    return given | {name: options | given.get(name, {}) for name in led}


def _answer(campaign: "Campaign", folder: Path, is_interrupted: bool) -> Answer:
    from lidarium.evaluation.suites.campaign import EPISODES_FILE
    from lidarium.evaluation.suites.episodes_file import read_episodes

    for trial, error in campaign.failures:
        notify(f"{trial.key}: {type(error).__name__}: {error}")
    keys = {trial.key for trial in campaign.trials or ()}
    episodes = [episode for episode in read_episodes(folder / EPISODES_FILE) if episode["key"] in keys]
    if len(episodes) < campaign.done:
        raise FileNotFoundError(
            f"{folder / EPISODES_FILE} holds {len(episodes)} of the {campaign.done} episodes that were "
            "finished; somebody has removed or replaced it meanwhile, run the same command again"
        )
    rows = summary_of(episodes)
    result = {
        "folder": str(folder),
        "episodes": campaign.total,
        "finished": campaign.done,
        "failed": [
            {"key": trial.key, "error": f"{type(error).__name__}: {error}"} for trial, error in campaign.failures
        ],
        "interrupted": is_interrupted,
        "summary": rows,
    }
    how = " (interrupted; the same command goes on)" if is_interrupted else ""
    shown = [tuple(_shown(value) for value in row.values()) for row in rows]
    text = "\n".join(
        [
            f"{campaign.done} of {campaign.total} episodes finished, {len(campaign.failures)} failed{how}",
            table(
                shown,
                (
                    "settings",
                    "policy",
                    "robots",
                    "episodes",
                    "t99 median [s]",
                    "not reached",
                    "coverage",
                    "path [m]",
                    "overlap",
                ),
            ),
            f"  {folder}; `lidarium report {folder}` makes tables with intervals, and plots",
        ]
    )
    failing = {name: said for episode in episodes for name, said in episode.get("failed_metrics", {}).items()}
    for name, said in failing.items():
        count = sum(name in episode.get("failed_metrics", {}) for episode in episodes)
        notify(f"metric {name!r} failed in {count} of {len(episodes)} episodes: {said}")
    code = DONE if not failing else DOUBTFUL
    code = INTERRUPTED if is_interrupted else DEFECT if campaign.failures else code
    return Answer(result, text, code)


def summary_of(episodes: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return medians by settings, policy and size of the team.

    A median time is None if half did not reach it.
    """
    groups: dict[tuple[str, str, int], list[Mapping[str, Any]]] = {}
    for episode in episodes:
        groups.setdefault((episode["variant"], episode["policy"], episode["robots"]), []).append(episode)
    rows = []
    for (variant, policy, robots), group in sorted(
        groups.items(), key=lambda item: (item[0][0], item[0][2], item[0][1])
    ):
        times = [episode["t99_s"] if episode["t99_s"] is not None else float("inf") for episode in group]
        median = statistics.median(times)
        rows.append(
            {
                "variant": variant,
                "policy": policy,
                "robots": robots,
                "episodes": len(group),
                "t99_s": None if median == float("inf") else round(median, 3),
                "not_reached": sum(time == float("inf") for time in times),
                "coverage": round(statistics.median(episode["coverage_final"] for episode in group), 6),
                "path_m": round(statistics.median(sum(episode["path_m"]) for episode in group), 3),
                "overlap": round(statistics.median(episode["overlap"] for episode in group), 6),
            }
        )
    return rows


def _shown(value: object) -> str:
    if value is None:
        return "-"
    return f"{value:.2f}" if isinstance(value, float) else str(value)
