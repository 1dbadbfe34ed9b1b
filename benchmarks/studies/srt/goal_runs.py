"""Runs of the tree towards the goals of the worlds: what is measured of each."""

import math
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.agents.srt.policy import SensorBasedRandomTree
from lidarium.benchmarks.studies.shared.map_figures import THESIS, MapFigures, map_figures
from lidarium.benchmarks.studies.shared.study import Task
from lidarium.benchmarks.studies.srt.shortest_path import shortest_path
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.floors.catalogue.names import load_floor
from lidarium.envs.settings.making import make_settings
from lidarium.evaluation.episodes.runner import Episode, run_episode
from lidarium.evaluation.episodes.watching import WatchedExploration, Watcher
from lidarium.evaluation.suites.episodes_file import KEY
from lidarium.mapping.localization.on_splines.spline_tracking import SplineTracker

WORLDS = ("srt_corridor", "srt_l_room", "srt_lab", "srt_t_junction", "srt_cluttered", "srt_cluttered_reachable")
MODES = ("thesis", "default")
CONTROLS = {"drive": "controls"}
TREES: dict[str, tuple[str, dict[str, Any]]] = {
    "default": ("default", {}),
    "thesis": ("thesis", CONTROLS),
    "thesis, turn and advance": ("thesis", {}),
    "thesis, ball": ("thesis", {**CONTROLS, "shape": "ball"}),
    "thesis, radial": ("thesis", {**CONTROLS, "shape": "radial"}),
    "thesis, base": ("thesis", {**CONTROLS, "algorithm": "base"}),
    "thesis, farthest points": ("thesis", {**CONTROLS, "candidates": "farthest"}),
}
"""Trees by name: mode and settings. Of the thesis are MOVE_TO with the list of controls, and safe regions as stars."""

VARIED_ON = ("srt_l_room", "apartment")
"""Floors on which trees are compared: one with a goal, one that is explored with true poses."""
GOAL_RADIUS = 0.2

SETTINGS: dict[str, Any] = {
    "robots": 1,
    "robot": "pioneer",
    "noise": "datasheet",
    "odometry": "typical",
    "localization": "splines",
    "resolution": 0.05,
    "raster_resolution": 0.01,
    "stop_coverage": None,
    "horizon_s": 1200.0,
    "goal_radius": GOAL_RADIUS,
    "observe": ("scan", "pose", "bumper"),
    "map_cells": 2,
}
"""Settings of a Pioneer with the laser of the thesis.

It has the laser's range noise, and wheels that report 5 % too much or too little.
"""

CURVE_PERIOD = 10
"""Steps between the points of a curve of coverage."""


@dataclass(frozen=True, slots=True)
class GoalRun(Task):
    """A run: the mode of the tree, the world and the seed."""

    mode: str
    world: str
    seed: int


class Way(Watcher):
    """What a robot measured and believed on its way, and the truth."""

    def __init__(self) -> None:
        self.ranges: list[NDArray[np.float32]] = []
        self.true: list[NDArray[np.float64]] = []
        self.believed: list[NDArray[np.float64]] = []
        self.odometry: list[NDArray[np.float64]] = []
        self.coverage: list[float] = []
        self.returns = 0
        self._updates = 0

    def begin(self, env: ExplorationEnv) -> None:
        """Note the start."""
        self.step(env, np.empty(0))

    def step(self, env: ExplorationEnv, commands: NDArray[np.float64], /) -> None:
        """Note a time step."""
        world = env.world
        self.ranges.append(env.simulation.ranges[0].copy())
        self.true.append(world.poses[0].copy())
        self.believed.append(env.beliefs.believed[0].copy())
        self.odometry.append(env.simulation.odometry[0].copy())
        self.coverage.append(env.scorer.coverage)
        updates = tracker_of(env).updates
        if updates > self._updates:
            self.returns += int((self.ranges[-1] < env.settings.lidar.range_max).sum())
        self._updates = updates

    def outcome(self, env: ExplorationEnv) -> None:
        """Note nothing."""


def tracker_of(env: ExplorationEnv) -> SplineTracker:
    """Return the localizer on curves of the robot."""
    localizer = env.perception.poses.localizers[0]
    if not isinstance(localizer, SplineTracker):
        raise ValueError(f"localization is {env.settings.localization!r}; want splines or splines_ekf")
    return localizer


def drive_to_goal(run: GoalRun) -> tuple[Episode, SensorBasedRandomTree, Way]:
    """Let a robot look for the goal of a world."""
    mode, settings = TREES[run.mode]
    way, policy = Way(), SensorBasedRandomTree(mode, **settings)
    localizer = THESIS if mode == "thesis" else None
    env = WatchedExploration(run.world, make_settings(**SETTINGS, localizer=localizer), watchers=[way])
    return run_episode(policy, env, run.seed), policy, way


def measure_tree(run: GoalRun) -> dict[str, Any]:
    """Let a tree look for the goal of a floor, or explore one that has none with true poses; return the run's line."""
    mode, settings = TREES[run.mode]
    policy = SensorBasedRandomTree(mode, **settings)
    chosen = SETTINGS | {"localizer": THESIS if mode == "thesis" else None}
    if load_floor(run.world).goal is None:
        chosen |= {"localization": "truth", "localizer": None, "stop_coverage": 0.99}
    env = ExplorationEnv(run.world, make_settings(**chosen))
    run_episode(policy, env, run.seed)
    return _line(run, env, policy)


def _line(run: GoalRun, env: ExplorationEnv, policy: SensorBasedRandomTree) -> dict[str, Any]:
    return {
        KEY: run.key,
        "mode": run.mode,
        "world": run.world,
        "seed": run.seed,
        "ending": env.scorer.ended_because[env.possible_agents[0]],
        "time_s": env.scorer.time,
        "nodes": len(policy.tree.nodes),
        "path_m": float(env.world.travelled[0]),
        "coverage": env.scorer.coverage,
        "collisions": int(env.world.collisions.sum()),
    }


def measure_goal_run(run: GoalRun) -> dict[str, Any]:
    """Run and measure; returns the run's line."""
    episode, policy, way = drive_to_goal(run)
    env = episode.env
    floor, goal, tables = env.floor, env.goal, env.world.floors[0]
    assert floor is not None
    assert goal is not None
    assert tables is not None
    start = way.true[0][:2]
    shortest = shortest_path(tables, (float(start[0]), float(start[1])), goal, env.settings.robot.radius)
    curve = [*way.coverage[::CURVE_PERIOD], way.coverage[-1]]
    return {
        **_line(run, env, policy),
        "shortest_m": None if shortest is None else shortest - GOAL_RADIUS,
        "from_start_m": math.dist(way.true[-1][:2], start),
        "coverage_curve": [round(share, 4) for share in curve],
        **asdict(figures_of(env, way)),
    }


def figures_of(env: ExplorationEnv, way: Way) -> MapFigures:
    """Return how well the robot's localizer did."""
    assert env.floor is not None
    true, believed, odometry = (np.array(poses) for poses in (way.true, way.believed, way.odometry))
    return map_figures(env.floor, tracker_of(env).map, env.settings.lidar, true, believed, odometry, way.returns)
