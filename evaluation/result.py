"""What a run found, as the dictionary of ``result.json`` (docs/reference/files.md)."""

import hashlib
import json
import math
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

import lidarium
from lidarium.agents.policy import GivenUp
from lidarium.envs.coverage import unpack_bits
from lidarium.envs.exploration import ExplorationEnv
from lidarium.envs.scorer import THRESHOLDS
from lidarium.envs.settings import ExplorationSettings
from lidarium.evaluation.metrics import decision_percentiles, occupied_iou, overlap
from lidarium.evaluation.runner import Episode


def result_of(episode: Episode, policy: str | None = None) -> dict[str, Any]:
    """Return the figures of an episode, finished or interrupted, as ``result.json`` has them.

    Parameters
    ----------
    episode : Episode
        What `run_episode` left; its environment must have been reset.
    policy : str or None
        Name of the policy; that of its class where None.

    Returns
    -------
    dict
        Ready for JSON. Times are simulated [s], lengths in metres; positions of ``given_up`` are in the floor's frame.
        ``ended_because`` is None for robots that an interrupted run left at work.

    Raises
    ------
    ValueError
        Where the episode was interrupted before it began.
    """
    env, settings, scorer, world = episode.env, episode.env.settings, episode.env.scorer, episode.env.world
    if env.floor is None:
        raise ValueError("the episode was interrupted before it began, there is no result")
    steps = max(int(world.steps[0]), 0)
    return {
        "floor": env.floor.name,
        "robots": settings.robots,
        "policy": policy or type(episode.policy).__name__,
        "backend": settings.backend,
        "localization": settings.localization,
        "realism": realism_of(settings),
        "seed": episode.seed,
        "horizon_s": settings.horizon_s,
        "interrupted": episode.is_interrupted,
        "coverage_final": round(scorer.coverage, 9),
        "time_s": round(scorer.time, 6),
        **{f"t{round(100 * share)}_s": _time(scorer.times.get(share)) for share in THRESHOLDS},
        "path_m": [round(float(length), 6) for length in world.travelled],
        "overlap": round(overlap(world.masks), 9),
        "collisions": int(world.collisions.sum()),
        "ended_because": {agent: scorer.ended_because.get(agent) for agent in env.possible_agents},
        "given_up": [_entry(env, given_up) for given_up in episode.given_up],
        # The localizer is the truth: no error.
        "ate_m": [0.0] * settings.robots,
        "iou_occupied": round(iou_of(env), 9),
        "merges": {"accepted": 0, "correct": 0, "false": 0, "first_correct_s": None},
        "decision_ms": decision_percentiles(episode.decision_seconds),
        "steps_per_s": round(steps / episode.wall_seconds, 3) if episode.wall_seconds > 0.0 else None,
        "version": lidarium.__version__,
        "floor_sha256": env.floor.sha256,
        "settings_sha256": settings_sha256(settings),
    }


def realism_of(settings: ExplorationSettings) -> str:
    """Return ``ideal`` where sensors and poses are perfect, else ``custom``."""
    return "custom" if settings.lidar.is_noisy or settings.localization != "truth" else "ideal"


def settings_sha256(settings: ExplorationSettings) -> str:
    """Return a hash of all settings that can change a result: of their JSON with sorted keys, without ``threads``."""
    values = {name: value for name, value in asdict(settings).items() if name != "threads"}
    return hashlib.sha256(json.dumps(values, sort_keys=True, separators=(",", ":")).encode()).hexdigest()


def team_log_odds(env: ExplorationEnv) -> tuple[NDArray[np.int16], tuple[float, float]]:
    """Return the sum of the robots' maps, and the lower left corner of its cell (0, 0) in the floor's frame [m].

    The lattice is that of the scorer's masks. Maps of robots that do not know their starts are laid over it by their true
    starts: with true poses that is the best fit of the trajectories.
    """
    world, settings = env.world, env.settings
    tables = world.floors[0]
    assert tables is not None
    origin, resolution = tables.laser.origin, settings.occupancy.resolution
    if settings.known_starts:
        return np.asarray(np.sum(world.log_odds, axis=0, dtype=np.int16)), origin
    rows, words = world.counted_masks[0].shape
    total = np.zeros((rows, words * 64), np.int16)
    y, x = np.meshgrid(*((np.arange(size) + 0.5) * resolution for size in total.shape), indexing="ij")
    for row, log_odds in enumerate(world.log_odds):
        start_x, start_y, theta = world.starts[row]
        east, north = x + origin[0] - start_x, y + origin[1] - start_y
        own_x = math.cos(theta) * east + math.sin(theta) * north - world.origins[row, 0]
        own_y = math.cos(theta) * north - math.sin(theta) * east - world.origins[row, 1]
        columns, lines = (np.floor(own / resolution).astype(np.int64) for own in (own_x, own_y))
        is_inside = (lines >= 0) & (lines < log_odds.shape[0]) & (columns >= 0) & (columns < log_odds.shape[1])
        total[is_inside] += log_odds[lines[is_inside], columns[is_inside]]
    return total, origin


def occupied_in_truth(env: ExplorationEnv) -> NDArray[np.bool_]:
    """Return the truth on the lattice of the maps: cells of which any of the world's cells is solid; free beyond the world's raster."""
    tables = env.world.floors[0]
    assert tables is not None
    raster = tables.laser
    multiple = round(env.settings.occupancy.resolution / raster.resolution)
    rows, words = env.world.counted_masks[0].shape
    solid = np.zeros((rows * multiple, words * 64 * multiple), np.bool_)
    solid[: raster.solid.shape[0], : raster.solid.shape[1]] = raster.solid
    return np.asarray(solid.reshape(rows, multiple, words * 64, multiple).any(axis=(1, 3)))


def iou_of(env: ExplorationEnv) -> float:
    """Return ``iou_occupied`` of the team's map."""
    believed = np.asarray(team_log_odds(env)[0] > 0)
    return occupied_iou(believed, occupied_in_truth(env), unpack_bits(env.world.team_masks[0], believed.shape[1]))


def in_floor_frame(env: ExplorationEnv, agent: str, x: float, y: float) -> tuple[float, float]:
    """Return a position of a robot's map frame in the floor's frame [m]."""
    row = env.possible_agents.index(agent)
    if env.settings.known_starts:
        offset = env.perception.offset(row)
        return float(x + offset[0]), float(y + offset[1])
    start_x, start_y, theta = env.world.starts[row]
    return (
        float(start_x + math.cos(theta) * x - math.sin(theta) * y),
        float(start_y + math.sin(theta) * x + math.cos(theta) * y),
    )


def _entry(env: ExplorationEnv, given_up: GivenUp) -> dict[str, Any]:
    x, y = in_floor_frame(env, given_up.agent, given_up.x, given_up.y)
    return {"agent": given_up.agent, "x": round(x, 4), "y": round(y, 4), "size_m": round(given_up.size_m, 4), "reason": given_up.reason}


def _time(seconds: float | None) -> float | None:
    return None if seconds is None else round(seconds, 6)
