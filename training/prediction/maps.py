"""Partial maps of robots that explore, with the truth about the rest, in files."""

import io
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lidarium.agents import make_policy
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.faces.team import EpisodeTeam
from lidarium.envs.floors.catalogue.names import SETS
from lidarium.envs.floors.floor import Floor
from lidarium.envs.floors.generation.buildings import BuildingSettings, generate_building
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.settings.making import make_settings
from lidarium.evaluation.suites.starts import drawn_starts
from lidarium.evaluation.truth.floor_predictor import FloorPredictor
from lidarium.mapping.files.guarded_reading import GuardedArchive, read_bytes, reading
from lidarium.mapping.files.output import write_whole
from lidarium.mapping.prediction.levels import factor_of, levels_of
from lidarium.mapping.prediction.predictors import PartialMap
from lidarium.training.prediction.dungeons import draw_dungeon
from lidarium.training.prediction.plans import draw_plan, plan_number
from lidarium.training.prediction.settings import DUNGEON, PLAN, PredictionSettings

EXPLORERS = ("nearest_frontier", "tour_frontier")
LIDARS = ("urg", "urg", "lidar_360_6m", "lidar_360_20m")
COVERAGES = (0.02, 0.97)
"""Maps are taken when a team has seen so much, at least and at most."""

BUILDING_SEEDS, PLAN_SEEDS = 2, 12
"""Floors of a seed differ from those that other trainings make of it by these second words of their draws."""


@dataclass(frozen=True, slots=True)
class FloorMaps:
    """Partial maps of one floor.

    Attributes
    ----------
    levels : (n, rows, columns) int8
        The maps: -1 free, 0 unknown, 1 occupied squares.
    is_free : (rows, columns) bool
        The truth.
    """

    levels: NDArray[np.int8]
    is_free: NDArray[np.bool_]


def source_of(settings: PredictionSettings, number: int) -> tuple[int, ...]:
    """Return the source of the n-th floor: its plan, or the floor alone if it is generated."""
    if _drawn_kind(settings, number)[0] == PLAN:
        return (plan_number(settings.plans, _plan_seed(settings, number)), PLAN_SEEDS)
    return (number,)


def _drawn_kind(settings: PredictionSettings, number: int) -> tuple[str, np.random.Generator]:
    """Return the kind of the n-th floor, and the generator of what else is drawn."""
    generator = np.random.default_rng([settings.seed, BUILDING_SEEDS, number])
    often = np.array(list(settings.kinds.values()), np.float64)
    return str(generator.choice(list(settings.kinds), p=often / often.sum())), generator


def _plan_seed(settings: PredictionSettings, number: int) -> tuple[int, int, int]:
    return settings.seed, PLAN_SEEDS, number


def floor_of(settings: PredictionSettings, number: int) -> Floor:
    """Return the n-th floor of a training; buildings are of seeds of the training set, with sizes of many plans."""
    kind, generator = _drawn_kind(settings, number)
    seed = SETS["train"][0] + number
    if kind == DUNGEON:
        return draw_dungeon(seed)
    if kind == PLAN:
        return draw_plan(settings.plans, _plan_seed(settings, number), settings.bare_share)
    is_bare, is_usual = generator.random() < settings.bare_share, generator.random() < 0.6
    clutter = 0.0 if is_bare else None
    if is_usual:
        return generate_building(seed, BuildingSettings(kind=kind, clutter=clutter))
    return generate_building(
        seed,
        BuildingSettings(
            kind=kind,
            clutter=clutter,
            door_width=float(generator.uniform(0.8, 1.0)),
            wall_thickness=float(generator.uniform(0.05, 0.3)),
            rotation=float(generator.uniform(-0.8, 0.8)) if generator.random() < 0.4 else 0.0,
        ),
    )


def explore(settings: PredictionSettings, number: int) -> FloorMaps:
    """Let robots explore the n-th floor, and return their partial maps."""
    generator = np.random.default_rng([settings.seed, 3, number])
    team = make_settings(
        robots=int(generator.integers(1, 4)),
        lidar=str(generator.choice(LIDARS)),
        noise="datasheet" if generator.random() < settings.noisy_share else "none",
        resolution=0.05,
        horizon_s=900.0,
        stop_coverage=0.99,
    )
    # Early maps are small and tell little; most are taken later.
    wanted = generator.uniform(*COVERAGES, settings.maps)
    return partial_maps(floor_of(settings, number), team, str(generator.choice(EXPLORERS)), number, wanted)


def partial_maps(
    floor: str | Floor, team: ExplorationSettings, explorer: str, seed: int, coverages: NDArray[np.float64]
) -> FloorMaps:
    """Let a team explore a floor, and return its maps whenever it has seen one of some shares of the floor."""
    env, policy = ExplorationEnv(floor, team), make_policy(explorer)
    env.use_level(policy.level, policy.shares_map, policy.decision_period_s)
    starts = drawn_starts(floor, team, seed)
    observations, _ = env.reset(seed=seed, options=None if starts is None else {"starts": starts})
    handle, truth = EpisodeTeam(env.engine), FloorPredictor()
    policy.reset(handle, seed)
    truth.reset(handle)
    agent = handle.agents[0]
    navigation = handle.belief(agent).shared_map or handle.belief(agent).map
    factor = factor_of(navigation.resolution)
    start = PartialMap(levels_of(navigation.log_odds, factor), factor * navigation.resolution, agent)
    is_free = truth.predict(start) > 0.5
    left, taken = np.sort(coverages), list[NDArray[np.int8]]()
    while len(left) and env.agents:
        seen = env.scorer.coverage
        if seen >= left[0]:
            left = left[left > seen]
            taken.append(levels_of(navigation.log_odds, factor))
        observations = env.step(policy.act(observations))[0]
        observations = {name: observations[name] for name in env.agents}
    return FloorMaps(np.stack(taken) if taken else np.zeros((0, *is_free.shape), np.int8), is_free)


def write_maps(path: Path, maps: FloorMaps) -> None:
    """Write the maps of a floor to a file, whole or not at all."""
    content = io.BytesIO()
    np.savez_compressed(content, allow_pickle=False, levels=maps.levels, is_free=maps.is_free)
    write_whole(path, content.getvalue(), is_lasting=False)


def read_maps(path: Path) -> FloorMaps:
    """Read the file of ``write_maps``."""
    with reading(path, "partial maps of a training", "remove it, and the same command explores there again"):
        archive = GuardedArchive(read_bytes(path))
        levels, is_free = archive.array("levels"), archive.array("is_free")
        if (
            levels.ndim != 3
            or levels.dtype != np.int8
            or levels.shape[1:] != is_free.shape
            or is_free.dtype != np.bool_
        ):
            raise ValueError(f"it has levels {levels.dtype} {levels.shape} and is_free {is_free.dtype} {is_free.shape}")
        return FloorMaps(levels, is_free)
