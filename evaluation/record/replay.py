"""Runs a recorded episode again, from its beginning and the speeds of its robots.

A hash of everything that an episode leaves in its world tells whether the end is the same.
"""

import hashlib
import json
from collections.abc import Callable, Iterable
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import lidarium
from lidarium.envs.engine.beginnings import EpisodeStart
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.floors.areas import around
from lidarium.envs.floors.catalogue.names import is_file_name, load_floor
from lidarium.envs.floors.floor import Floor
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.settings.making import make_settings
from lidarium.envs.simulation.kernels.floor_cache import floor_tables
from lidarium.evaluation.episodes.settings_identity import settings_sha256
from lidarium.evaluation.episodes.watching import WatchedExploration, Watcher
from lidarium.evaluation.record.episode_record import EpisodeRecord
from lidarium.mapping.files.guarded_reading import reason as said_by

_ARRAYS = (
    "steps",
    "poses",
    "believed",
    "velocities",
    "ranges",
    "bumpers",
    "contacts",
    "travelled",
    "collisions",
    "seen",
    "team_seen",
    "counted",
)


def state_sha256(env: ExplorationEnv) -> str:
    """Return a hash of the state of an environment's world, to the bit.

    It covers the number of steps; true and believed poses, velocities, scans, bumpers and contacts; paths,
    collisions and counts of seen cells; the scorer's masks and the robots' maps; and why each robot ended. It does
    not cover derived data: observations, plans, clearance.
    """
    simulation = env.simulation
    owners = (simulation, simulation.world, simulation.beliefs, simulation.score)
    digest = hashlib.sha256()
    for name in _ARRAYS:
        _add(digest, name, next(getattr(owner, name) for owner in owners if hasattr(owner, name)))
    for name in ("masks", "team_masks", "counted_masks"):
        for mask in getattr(env.score, name):
            _add(digest, name, mask)
    for log_odds in env.beliefs.log_odds:
        _add_map(digest, log_odds)
    digest.update(json.dumps(env.scorer.ended_because, sort_keys=True).encode())
    return digest.hexdigest()


def _add(digest: "hashlib._Hash", name: str, array: NDArray[Any]) -> None:
    digest.update(f"{name} {array.dtype.str} {array.shape};".encode())
    digest.update(np.ascontiguousarray(array).data)


def _add_map(digest: "hashlib._Hash", log_odds: NDArray[np.int8]) -> None:
    """Add the rows of a map from the first to the last that is not blank.

    Much of a large map was never touched.
    """
    used = np.flatnonzero(log_odds.view(np.uint64).any(axis=1))
    low, high = (int(used[0]), int(used[-1]) + 1) if used.size else (0, 0)
    digest.update(f"map {log_odds.shape} from row {low};".encode())
    _add(digest, "log_odds", log_odds[low:high])


ADDED = frozenset({"camera", "doors", "graph", "lidars", "localizer", "people", "scan_period_s", "sparse_map"})
"""Settings that older records do not have."""


def rerun(
    record: EpisodeRecord, floor: str | Path | Floor | None = None, watchers: Iterable[Watcher] = ()
) -> ExplorationEnv:
    """Run a recorded episode again and check that its end state is the same.

    It must be the same to the bit.
    """
    env = drive_again(record, floor, watchers)
    if not is_same(record, env):
        raise ValueError(f"the episode does not run as it was recorded: {first_difference(record, env)}")
    return env


BeforeStep = Callable[[ExplorationEnv, dict[str, Any], NDArray[np.float64]], None]
"""Takes the environment, the observations at the level of velocities, and the speeds of the next step."""


def drive_again(
    record: EpisodeRecord,
    floor: str | Path | Floor | None = None,
    watchers: Iterable[Watcher] = (),
    before_step: BeforeStep | None = None,
) -> ExplorationEnv:
    """Run a recorded episode again, as `rerun`, without a check of how it ends."""
    header = record.header
    if header["version"] != lidarium.__version__:
        raise ValueError(
            f"the record is of lidarium {header['version']}, this is {lidarium.__version__}; only the "
            "version that recorded an episode "
            f"runs it again, its pictures and films can be drawn by any"
        )
    if header["final_sha256"] is None:
        raise ValueError(
            "the episode was broken off within a time step, its last state is not known; pictures and films "
            "can be drawn"
        )
    settings = _settings_of(header)
    there = find_floor(header, floor)
    tables = floor_tables(there, settings.raster_resolution, settings.lidar.height, settings.robot.height)
    goal = None if header["goal"] is None else (header["goal"][0], header["goal"][1])
    # The recorded speeds have all pauses in them; no station would end a pause of the re-run.
    env = WatchedExploration(there, replace(settings, pauses_when_blocked=False), watchers=watchers)
    if before_step is not None:
        env.use_level("velocity")
    start = EpisodeStart(there, tables, np.array(header["starts"], np.float64), header["noise_seed"], goal)
    observations, _ = env.start(start)
    endings: dict[int, list[tuple[str, str]]] = {}
    for step, agent, reason in header["endings"]:
        endings.setdefault(step, []).append((agent, reason))
    for step, commands in enumerate(np.array(record.commands, np.float64), 1):
        if before_step is not None:
            before_step(env, observations, commands)
        env.drive_at(commands)
        if before_step is not None:
            observations = env.outcome()[0]
        if step in endings:
            _end(env, endings[step])
    return env


def is_same(record: EpisodeRecord, env: ExplorationEnv) -> bool:
    """Whether an environment is in the state in which a record ends, to the bit."""
    return bool(state_sha256(env) == record.header["final_sha256"])


def first_difference(record: EpisodeRecord, env: ExplorationEnv) -> str:
    """Describe the time and position at which a re-run first leaves the recorded paths.

    The versions of the record are included.
    """
    made_with = ", ".join(f"{name} {version}" for name, version in record.header.get("made_with", {}).items())
    display = record.display
    for time_s, poses in env.scorer.track:
        apart = np.hypot(*(poses - display.poses_at(time_s))[:, :2].T)
        # Recorded positions are rounded to a millimetre.
        if apart.max() > 1e-3:
            robot = env.possible_agents[int(apart.argmax())]
            return f"{robot} is {apart.max():.3f} m off at {time_s:.1f} s (recorded with {made_with})"
    return f"the ways are the same to a millimetre, the final state is not to the bit (recorded with {made_with})"


def _settings_of(header: dict[str, Any]) -> ExplorationSettings:
    """Return the settings of a record."""
    missing = {each.name for each in fields(ExplorationSettings)} - set(header["settings"]) - ADDED
    if missing:
        raise ValueError(
            f"the settings of the record are not those of lidarium {lidarium.__version__}: no {min(missing)}"
        )
    try:
        settings = make_settings(**header["settings"])
    except (TypeError, AttributeError) as error:
        raise ValueError(
            f"the settings of the record are not those of lidarium {lidarium.__version__}: {said_by(error)}"
        ) from error
    found = settings_sha256(settings)
    if header["settings_sha256"] not in (found, settings_sha256(settings, has_observe=True)):
        raise ValueError(
            f"the settings of the record have the hash {found}, not {header['settings_sha256']} as recorded"
        )
    return settings


def find_floor(header: dict[str, Any], floor: str | Path | Floor | None = None) -> Floor:
    """Return the floor of a record: the given one, by default the one that the record names."""
    names = (
        [floor]
        if floor is not None
        else list(dict.fromkeys(name for name in (header["floor_source"], header["floor"]) if name))
    )
    tried = []
    for name in names:
        is_file = not isinstance(name, Floor) and is_file_name(name)
        try:
            found = load_floor(name, header["image_resolution"] if is_file else None)
            if found.sha256 != header["floor_sha256"]:
                found = around(found, np.array(header["starts"], np.float64))
        except (ValueError, OSError) as error:
            tried.append(str(error))
            continue
        if found.sha256 == header["floor_sha256"]:
            return found
        what = f"floor {found.name!r}" if isinstance(name, Floor) else str(name)
        tried.append(f"{what} has the hash {found.sha256[:12]}, the record's floor has {header['floor_sha256'][:12]}")
    raise ValueError(
        f"the floor {header['floor']!r} of the record is not found: {'; '.join(tried)}; name the floor that "
        "was recorded"
    )


def _end(env: ExplorationEnv, endings: list[tuple[str, str]]) -> None:
    """Let robots end as they did; the horizon ends them by itself."""
    horizon = env.settings.horizon_steps
    for agent, reason in endings:
        if reason != "horizon" or horizon is None or int(env.world.steps[0]) < horizon:
            env.stop(agent, reason)
    env.outcome()
