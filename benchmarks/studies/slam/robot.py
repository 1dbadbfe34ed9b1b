"""What SLAM costs a simulated robot, and how far off it is."""

import math
import time
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from lidarium.agents import make_policy
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.settings.making import make_settings
from lidarium.evaluation.episodes.runner import run_episode
from lidarium.evaluation.episodes.watching import WatchedExploration, Watcher
from lidarium.mapping.geometry.rigid import composed, relative
from lidarium.mapping.localization.localizer import Sensing
from lidarium.mapping.localization.settings import SlamSettings
from lidarium.mapping.localization.slam.localizer import Slam


@dataclass(frozen=True, slots=True)
class Robot:
    """What SLAM costs a simulated robot, and how far off it is.

    `match_ms`, `closure_ms`, `correction_ms` (calls,) float64: CPU time of a scan that is matched and drawn into the
    map, of one that recognised a place, and of one that corrected the past; `error_m`, `odometry_m`: root mean square
    of the positions given at each time against the true ones, unaligned, and of odometry [m]; `path_m`: length of the
    path [m].
    """

    match_ms: NDArray[np.float64]
    closure_ms: NDArray[np.float64]
    correction_ms: NDArray[np.float64]
    error_m: float
    odometry_m: float
    path_m: float


@dataclass(slots=True)
class _Recorder(Watcher):
    """Keeps what a robot's laser saw, and from where."""

    scans: list[NDArray[np.float32]] = field(default_factory=list)
    poses: list[NDArray[np.float64]] = field(default_factory=list)

    def begin(self, env: ExplorationEnv) -> None:
        self.step(env, np.zeros((1, 2)))

    def step(self, env: ExplorationEnv, commands: NDArray[np.float64], /) -> None:
        self.scans.append(env.simulation.ranges[0].copy())
        self.poses.append(env.world.poses[0].copy())

    def outcome(self, env: ExplorationEnv) -> None:
        pass


def recorded_robot(floor: str, horizon_s: float) -> tuple[ExplorationEnv, _Recorder]:
    """Let a robot explore a floor with noise of the data sheet; return what it sensed."""
    recorder = _Recorder()
    env = WatchedExploration(
        floor, make_settings(robots=1, noise="datasheet", horizon_s=horizon_s), watchers=[recorder]
    )
    run_episode(make_policy("nearest_frontier"), env, 0)
    return env, recorder


def measured_robot(floor: str, horizon_s: float) -> Robot:
    """Follow a robot whose wheels slip by 5 % and pull aside by 1 degree a metre."""
    env, recorder = recorded_robot(floor, horizon_s)
    slam = Slam(SlamSettings(), env.settings.lidar)
    true = np.stack(recorder.poses)
    slam.reset(true[0], 0)
    odometry, given = true[0].copy(), []
    path, dead = 0.0, []
    matched, closed, corrected = [], [], []
    for k, scan in enumerate(recorder.scans):
        if k:
            motion = relative(true[k - 1], true[k])
            distance = float(np.hypot(motion[0], motion[1]))
            path += distance
            odometry = composed(odometry, 1.05 * motion + np.array([0.0, 0.0, math.radians(1.0) * distance]))
        before = (slam.counts.matches, slam.counts.corrections, slam.pending)
        began = time.process_time()
        given.append(slam.localize(Sensing(0.1 * k, odometry, scan)))
        localized = time.process_time()
        slam.map  # noqa: B018
        drawn = time.process_time()
        dead.append(odometry)
        if k < 100:
            continue
        if slam.counts.corrections > before[1]:
            corrected.append(localized - began)
        elif slam.pending > before[2]:
            closed.append(localized - began)
        elif slam.counts.matches > before[0]:
            matched.append(drawn - began)
    gaps = (np.hypot(*(np.stack(found) - true)[:, :2].T) for found in (given, dead))
    error, odometry_error = (math.sqrt(float((gap**2).mean())) for gap in gaps)
    match_ms, closure_ms, correction_ms = (1e3 * np.array(seconds) for seconds in (matched, closed, corrected))
    return Robot(match_ms, closure_ms, correction_ms, error, odometry_error, path)


def robot_lines(robot: Robot, floor: str) -> list[str]:
    """Return what there is to say of a simulated robot."""

    def spread(values: NDArray[np.float64]) -> str:
        return (
            f"{np.median(values):.2f} | {np.percentile(values, 95):.2f} | {values.max():.2f}"
            if len(values)
            else "- | - | -"
        )

    return [
        f"A Kobuki with URG-04LX (727 beams, 5.6 m, noise of the data sheet) explores `{floor}` over "
        f"{robot.path_m:.0f} m; its odometry is 5 % too long and pulls aside by 1 degree a metre. Online positions are "
        f"off by {robot.error_m:.3f} m (root mean square, unaligned), those of odometry by {robot.odometry_m:.2f} m.",
        "",
        "| ms of CPU time | scans | median | p95 | most | to reach |",
        "|---|---|---|---|---|---|",
        f"| scan matched, local maps and map updated | {len(robot.match_ms)} | {spread(robot.match_ms)} | median 4 |",
        f"| scan that recognised a place | {len(robot.closure_ms)} | {spread(robot.closure_ms)} | 50 |",
        f"| scan with which the past was corrected | {len(robot.correction_ms)} | {spread(robot.correction_ms)} | 50 |",
    ]
