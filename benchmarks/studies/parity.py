"""The world of PyBullet besides the kinematic one: the same commands, from the same starts.

A robot drives at random for ten seconds in both worlds. Drives that touch nothing in either tell how far the
bodies come apart; in all, scans of both worlds at the same poses are compared, and contacts counted.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.benchmarks.studies.shared.study import Progress, Study, Task, do_missing, kept_lines
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.settings.making import make_settings
from lidarium.envs.simulation.bullet.bullet_world import LEAN, BulletWorld

ROBOTS = ("kobuki", "pioneer", "service")
FLOORS = ("apartment", "clinic", "scene_room", "scene_loop", *(f"building:{seed}" for seed in range(16)))
SEEDS = range(8)
DRIVE_S, HELD_S = 10.0, 1.0
"""How long a drive takes, and for how long a command is held [s]."""

DISTANCE_M, TURN_DEG = 0.05, 3.0
"""Within these 95 % of the free drives are to end."""

DRIVES_FILE = "drives.jsonl"

PAGE = """# Parity of the worlds

The same commands in the world of PyBullet and in the kinematic world, from the same starts: {floors} floors,
{seeds} seeds, {drive_s:.0f} s, with a new speed and turn rate every {held_s:.0f} s, drawn from -0.3 to 1 of the
greatest speed and from -0.6 to 0.6 of the greatest turn rate. *Free* drives touch nothing in either world.

To reach: 95 % of the free drives end within {distance_m} m and {turn_deg:.0f} deg of each other.

{table}

- *Apart*: distance and turn between the poses at the end. Wheels of PyBullet reach a new speed within
  milliseconds, the kinematic ones at once.
- *Steps in contact*: in PyBullet, in the kinematic world, and the share of steps with robots within 5 cm of each
  other in which both worlds agree.
- *Odometry off*: error of dead reckoning at the end of a drive with exact wheel encoders; free drives, and those
  with contact.
- *Scans*: at the poses of PyBullet's bodies, equal to the bit, in steps in which the body leans by less than
  2 deg.
"""


@dataclass(frozen=True, slots=True)
class Drive(Task):
    """A robot on a floor, and where its commands come from."""

    floor: str
    robot: str
    seed: int


def _commands(settings: Any, seed: int) -> NDArray[np.float64]:  # noqa: ANN401
    """Draw speeds and turn rates of a drive, (steps, 2) [m/s, rad/s]."""
    robot, held = settings.robot, round(HELD_S / settings.time_step)
    limits = np.array([robot.max_speed, robot.max_turn_rate])
    drawn = np.random.default_rng(seed).uniform((-0.3, -0.6), (1.0, 0.6), (round(DRIVE_S / HELD_S), 2))
    return np.repeat(drawn * limits, held, axis=0)


def measure(drive: Drive) -> dict[str, Any]:
    """Drive in both worlds; return how far apart they are."""
    options: dict[str, Any] = {"robots": 1, "robot": drive.robot, "resolution": 0.1, "localization": "odometry"}
    envs = [
        ExplorationEnv(drive.floor, make_settings(backend=backend, **options)) for backend in ("bullet", "kinematic")
    ]
    bullet, kinematic = (env.world for env in envs)
    assert isinstance(bullet, BulletWorld)
    probe = ExplorationEnv(drive.floor, make_settings(**options))
    for env in (*envs, probe):
        env.reset(seed=drive.seed)
    touches = np.zeros(3, np.int64)
    near = scans = same = 0
    for command in _commands(envs[0].settings, drive.seed):
        for env in envs:
            env.simulation.step(command[None])
        here, there = bool(bullet.contacts[0]), bool(kinematic.contacts[0])
        is_near = bool(np.hypot(*(bullet.poses[0] - kinematic.poses[0])[:2]) < 0.05)
        touches += here, there, is_near and here == there
        near += is_near
        if np.hypot(*bullet.attitudes[0, 1:]) <= LEAN:
            probe.world.poses[:] = bullet.poses
            probe.world.move_and_sense(command[None], moves_bodies=False)
            scans += 1
            same += np.array_equal(probe.world.true_ranges, bullet.true_ranges)
    start, reckoned = bullet.starts[0], bullet.odometry[0]
    turned = np.array([[math.cos(start[2]), -math.sin(start[2])], [math.sin(start[2]), math.cos(start[2])]])
    believed = np.array([*(start[:2] + turned @ reckoned[:2]), start[2] + reckoned[2]])
    envs[0].close()
    return {
        "floor": drive.floor,
        "robot": drive.robot,
        "apart": _apart(bullet.poses[0], kinematic.poses[0]),
        "odometry": _apart(bullet.poses[0], believed),
        "touches": touches.tolist(),
        "near": near,
        "scans": scans,
        "same": same,
    }


def _apart(one: NDArray[np.float64], other: NDArray[np.float64]) -> list[float]:
    """Return distance [m] and turn [deg] between two poses."""
    turn = math.degrees(abs(math.remainder(one[2] - other[2], math.tau)))
    return [math.hypot(*(one - other)[:2]), turn]


def work(folder: Path, _data: Path | None, every: int, workers: int) -> Progress:
    """Drive on every N-th floor."""
    drives = [Drive(floor, robot, seed) for floor in FLOORS[::every] for robot in ROBOTS for seed in SEEDS]
    yield from do_missing(folder / DRIVES_FILE, "drives", drives, measure, workers)


def table(lines: Sequence[Mapping[str, Any]]) -> str:
    """Return the table, a line for each robot."""
    rows = [
        "| robot | free drives | apart, median | apart, 95 % | reached | steps in contact | "
        "odometry off, 95 % | scans the same |",
        "|---|---:|---:|---:|---|---:|---:|---:|",
    ]
    for robot in ROBOTS:
        own = [line for line in lines if line["robot"] == robot]
        if own:
            rows.append(f"| {robot} | {' | '.join(_cells(own))} |")
    return "\n".join(rows)


def _cells(own: Sequence[Mapping[str, Any]]) -> list[str]:
    free = [line for line in own if not line["touches"][0] and not line["touches"][1]]
    touching = [line for line in own if line["touches"][0]]
    middle, most = (_share(free, "apart", share) for share in (0.5, 0.95))
    touches = np.array([line["touches"] for line in own]).sum(axis=0)
    near, scans, same = (sum(line[name] for line in own) for name in ("near", "scans", "same"))
    is_reached = most[0] <= DISTANCE_M and most[1] <= TURN_DEG
    off = [_shown(_share(some, "odometry", 0.95)) for some in (free, touching)]
    return [
        f"{len(free)} of {len(own)}",
        _shown(middle),
        _shown(most),
        "yes" if is_reached else "no",
        f"{touches[0]:,}; {touches[1]:,}; {100.0 * touches[2] / max(near, 1):.1f} %",
        "; ".join(off),
        f"{same:,} of {scans:,}",
    ]


def _share(lines: Sequence[Mapping[str, Any]], name: str, share: float) -> tuple[float, float]:
    values = np.array([line[name] for line in lines] or [[math.nan, math.nan]])
    metres, degrees = np.quantile(values, share, axis=0).tolist()
    return metres, degrees


def _shown(apart: tuple[float, float]) -> str:
    return f"{apart[0]:.3f} m, {apart[1]:.2f} deg"


def page(folder: Path) -> str:
    """Return the results as markdown."""
    return PAGE.format(
        floors=len(FLOORS),
        seeds=len(SEEDS),
        drive_s=DRIVE_S,
        held_s=HELD_S,
        distance_m=DISTANCE_M,
        turn_deg=TURN_DEG,
        table=table(kept_lines(folder / DRIVES_FILE)),
    )


STUDY = Study(page, work=work, quick=20)
