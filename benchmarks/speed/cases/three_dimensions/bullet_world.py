"""The world of PyBullet beside PyBullet as it is mostly used."""

import importlib.util
import math
import statistics
import time
from collections.abc import Sequence

import numpy as np

from lidarium.benchmarks.speed.harness.lines import Line, faster, shown
from lidarium.benchmarks.speed.harness.report import run_alone
from lidarium.benchmarks.speed.harness.timing import Effort, interleaved, repeated
from lidarium.benchmarks.speed.peers.bullet import SUBSTEPS, BulletRig, circling
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.floors.floor import Floor, Solid
from lidarium.envs.floors.generation.buildings import BuildingSettings, generate_building
from lidarium.envs.settings.making import make_settings
from lidarium.envs.simulation.bullet.bodies import Bodies

CORES, ROBOTS = 1, 3
SOLIDS = 350
LARGE = "1,620 m2, 330 solids"
TURN_RATE = math.pi / 4.0

NOTES = (
    "*World of PyBullet*: a step of 0.1 s of 3 Kobukis, 24 substeps, 727 beams each. *Rig*: the same robots by "
    "PyBullet's own calls, a body for each solid, with `rayTestBatch` or without scans; on a generated floor of 1,620 "
    "m2 with 330 solids.",
)


def house() -> Floor:
    """Return the first generated floor of 1,500 m2 between its walls, with 330 solids."""
    return generate_building(0, BuildingSettings(kind="apartment", area_m2=1500.0))


def boxes() -> Floor:
    """Return a floor of `SOLIDS` boxes, turned at random, that leave the middle free."""
    generator = np.random.default_rng(0)
    solids = []
    for k in range(SOLIDS):
        angle, size = generator.uniform(0.0, math.pi), generator.uniform(0.1, 1.0, 2)
        turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
        corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * size / 2.0 @ turn.T
        middle = np.array((2.0 + 2.2 * (k % 19), 2.0 + 2.2 * (k // 19)))
        solids.append(Solid(corners + middle))
    return Floor("boxes", (0.0, 0.0, 44.0, 44.0), tuple(solids))


def env_of(floor: str | Floor) -> ExplorationEnv:
    """Return an environment of the world of PyBullet."""
    return ExplorationEnv(floor, make_settings(robots=ROBOTS, backend="bullet", lidar="urg", horizon_s=None))


def measure(effort: Effort) -> list[Line]:
    """Compare steps, substeps of the floor alone, and times of resets."""
    name = "world of PyBullet, 3 robots, 727 beams, 24 substeps"
    if importlib.util.find_spec("pybullet") is None:
        return [faster(name, [1.0], "rig", None, 3.0)]
    large, still = house(), boxes()
    env = env_of(large)
    env.reset(seed=0)
    commands = np.tile((0.0, TURN_RATE), (ROBOTS, 1))
    robot, starts = env.settings.robot, env.world.starts
    rig, bare = (BulletRig(large, robot, starts, circling(robot)) for _ in range(2))
    alone = BulletRig(still, robot, np.zeros((0, 3)))
    ours_alone = Bodies([], SUBSTEPS / 240.0)
    ours_alone.begin(still, np.zeros((0, 3)))
    nobody = np.zeros((0, 2))
    seconds = interleaved(
        {
            "ours": repeated(lambda: env.world.move_and_sense(commands), ROBOTS),
            "rays": repeated(lambda: rig.step_and_scan(env.settings.lidar), ROBOTS),
            "bare": repeated(bare.step, ROBOTS),
            "still": repeated(lambda: ours_alone.step(nobody), SUBSTEPS),
            "still rig": repeated(alone.step, SUBSTEPS),
        },
        effort,
    )
    return [
        faster(name, seconds["ours"], "rig with rayTestBatch", seconds["rays"], 3.0),
        faster(name, seconds["ours"], "rig without scans", seconds["bare"], 0.85),
        _bounded(f"substep of {SOLIDS} static solids", seconds["still"], (1e6, "us", 20.0), seconds["still rig"]),
        _bounded("reset of that world, apartment", _resets(env_of("apartment"), effort), (1e3, "ms", 50.0)),
        _bounded(f"reset of that world, {LARGE}", _resets(env, effort), (1e3, "ms", 250.0)),
    ]


def _resets(env: ExplorationEnv, effort: Effort) -> list[float]:
    """Return the times of resets on a floor that is known [s]."""
    env.reset(seed=0)
    seconds = []
    for seed in range(2 * effort.rounds):
        began = time.perf_counter()
        env.reset(seed=seed)
        seconds.append(time.perf_counter() - began)
    return seconds


def _bounded(
    name: str, ours: Sequence[float], limit: tuple[float, str, float], rig: Sequence[float] | None = None
) -> Line:
    """Make the line of a time, with the unit's parts of a second, the unit and the most of it."""
    scale, unit, most = limit
    figure = scale * statistics.median(ours)
    peer = "-" if rig is None else f"a body a solid: {shown(scale * statistics.median(rig))} {unit}"
    return Line(name, f"{shown(figure)} {unit}", peer, None, most, figure, True, unit)


if __name__ == "__main__":
    run_alone(measure, "The world of PyBullet beside PyBullet as it is mostly used.")
