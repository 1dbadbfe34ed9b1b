"""A folder of many episodes for the page of a report, drawn from a few real ones."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import lidarium
from lidarium.envs.settings.making import make_settings
from lidarium.evaluation.episodes.result import result_of
from lidarium.evaluation.episodes.runner import run_episode
from lidarium.evaluation.episodes.watching import WatchedExploration
from lidarium.evaluation.record import EpisodeRecord, Recorder, write_record
from lidarium.mapping.files.output import write_text

FLOOR, TEAM, DURATION_S = "building:17", 3, 600.0
POLICIES = ("nearest_frontier", "utility_frontier", "explore_lite")
EPISODES, REPLAYS, FLOORS = 10_000, 30, 100
TEAMS = (1, 2, 3)


def real_episode(policy: str) -> tuple[EpisodeRecord, dict[str, Any]]:
    """Return the record of ten minutes of three robots, and the line of the episode."""
    recorder = Recorder(policy, 0, FLOOR)
    # Noise makes scans and maps larger than they are in an ideal world.
    settings = make_settings(
        robots=TEAM, resolution=0.025, horizon_s=DURATION_S, stop_coverage=1.0, noise="datasheet"
    )
    env = WatchedExploration(FLOOR, settings, watchers=[recorder])
    episode = run_episode(lidarium.policy(policy), env, 0)
    return recorder.finish(), result_of(episode, policy)


def write_folder(folder: Path, episodes: int, replays: int) -> None:
    """Write a folder as `lidarium evaluate` does, of which only the replays are of real episodes.

    Figures of the other lines are those of the real ones times draws, so that no two are the same: what is
    measured is the page, not the policies.

    Parameters
    ----------
    folder : Path
        Where to.
    episodes, replays : int
        How many lines, and how many of them have a record.
    """
    real = {policy: real_episode(policy) for policy in POLICIES}
    draws, lines = np.random.default_rng(0), []
    for k in range(episodes):
        policy, rest = POLICIES[k % len(POLICIES)], k // len(POLICIES)
        record, row = real[policy]
        is_recorded = k < replays
        team = TEAM if is_recorded else TEAMS[(rest // FLOORS) % len(TEAMS)]
        seed = rest if is_recorded else rest // (FLOORS * len(TEAMS))
        floor = row["floor"] if is_recorded else f"office:{1000 + rest % FLOORS}"
        line = {**row, "seed": seed, "robots": team, "floor": floor, "variant": "default", "record": None}
        line["path_m"] = row["path_m"][:team]
        if is_recorded:
            line["record"] = f"records/{policy}_{seed}.npz"
            write_record(folder / line["record"], replace(record, header={**record.header, "seed": seed}))
        else:
            factor = float(draws.lognormal(0.0, 0.3))
            times = {key: row[key] for key in ("t90_s", "t99_s") if row[key] is not None}
            line |= {key: round(min(time * factor, DURATION_S), 2) for key, time in times.items()}
            line["settings_sha256"] = f"{team:064d}" if team != TEAM else row["settings_sha256"]
            line["path_m"] = [round(length * factor, 2) for length in line["path_m"]]
        lines.append(json.dumps(line))
    write_text(folder / "episodes.jsonl", "\n".join(lines) + "\n")
