"""`lidarium bench`: how fast this machine runs our kernels, in a few seconds."""

import os
import platform
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

from lidarium.scripts.common import Answer, Command, table, tell


@dataclass(frozen=True, kw_only=True)
class Bench(Command):
    """Measure this machine on the package's own kernels, one thread: rays, map updates, agent steps, environment steps."""

    floor: str = "apartment"
    """where to measure: name in the catalogue, building:SEED, or a file with a scale of its own"""
    seconds: float = 0.5
    """wall time for each figure [s]"""

    def __post_init__(self) -> None:
        Command.__post_init__(self)
        if not 0.0 < self.seconds <= 60.0:
            raise ValueError(f"seconds is {self.seconds}; want more than 0 and at most 60")


TEAMS = (1, 3, 16)
_POSES = 256


def execute(command: Bench) -> Answer:
    """Measure and tell."""
    import lidarium
    from lidarium.envs.floors.catalogue import load_floor
    from lidarium.evaluation.output import check_writable, write_json

    if command.out is not None:
        check_writable(command.out)
    load_floor(command.floor)
    figures: dict[str, float] = {}
    for name, measure in _measures(command):
        tell(f"measuring {name}")
        figures[name] = round(measure(), 1)
    result: dict[str, Any] = {
        "floor": command.floor,
        "figures": figures,
        "threads": 1,
        "machine": {"processor": platform.processor() or platform.machine(), "cores": os.cpu_count(), "python": platform.python_version()},
        "version": lidarium.__version__,
    }
    if command.out is not None:
        write_json(command.out / "bench.json", result)
    rows = [(name, f"{value:,.0f}") for name, value in figures.items()]
    title = f"{command.floor}, URG-04LX (727 beams, 5.6 m), cells of 0.025 m, one thread, lidarium {lidarium.__version__}"
    return Answer(result, f"{title}\n{table(rows, ('per second', ''))}")


def _measures(command: Bench) -> list[tuple[str, Callable[[], float]]]:
    return [
        ("rays", partial(_rays, command)),
        ("map updates (727 beams)", partial(_map_updates, command)),
        *((f"agent steps of the kernel, {_team(robots)}", partial(_agent_steps, command, robots)) for robots in TEAMS),
        *((f"env.step, {_team(robots)}", partial(_environment_steps, command, robots)) for robots in TEAMS),
    ]


def _team(robots: int) -> str:
    return "1 robot" if robots == 1 else f"{robots} robots"


def _rate(work: Callable[[], int], seconds: float) -> float:
    """Return units of work per second; the first call, which may compile, does not count."""
    work()
    done, began = 0, time.perf_counter()
    while time.perf_counter() - began < seconds:
        done += work()
    return done / (time.perf_counter() - began)


def _prepared(command: Bench, robots: int, stop_coverage: float | None = None) -> Any:  # noqa: ANN401
    from lidarium.envs.exploration import ExplorationEnv
    from lidarium.envs.settings import make_settings

    settings = make_settings(robots=robots, resolution=0.025, horizon_s=None, stop_coverage=stop_coverage)
    env = ExplorationEnv(command.floor, settings)
    env.reset(seed=command.seed)
    return env


def _poses(command: Bench, env: Any) -> Any:  # noqa: ANN401
    """Draw poses where the robot fits, (256, 3) [m, rad]."""
    import numpy as np

    from lidarium.envs.floors.starts import configuration_space

    body = env.world.floors[0].body
    cells = np.argwhere(configuration_space(body, env.settings.robot.radius))
    generator = np.random.default_rng(command.seed)
    chosen = cells[generator.integers(len(cells), size=_POSES)]
    places = (chosen[:, ::-1] + generator.random((_POSES, 2))) * body.resolution + np.asarray(body.origin)
    return np.column_stack([places, generator.uniform(-np.pi, np.pi, _POSES)])


def _rays(command: Bench) -> float:
    import numpy as np

    from lidarium.envs.simulation.lidar import cast_scans

    env = _prepared(command, 1)
    tables, lidar = env.world.floors[0], env.settings.lidar
    poses = _poses(command, env)
    poses[:, :2] = (poses[:, :2] - np.asarray(tables.laser.origin)) / tables.laser.resolution
    ranges = np.empty((_POSES, lidar.beams))
    reach = lidar.range_max / tables.laser.resolution

    def work() -> int:
        cast_scans(tables.rays.addresses, poses, lidar.unit_vectors, lidar.angle_first, lidar.angle_increment, reach, ranges)
        return int(ranges.size)

    return _rate(work, command.seconds)


def _map_updates(command: Bench) -> float:
    import numpy as np

    from lidarium.envs.simulation.lidar import cast_scans
    from lidarium.mapping.occupancy import OccupancyGrid

    env = _prepared(command, 1)
    tables, lidar = env.world.floors[0], env.settings.lidar
    poses = _poses(command, env)
    in_cells = poses.copy()
    in_cells[:, :2] = (poses[:, :2] - np.asarray(tables.laser.origin)) / tables.laser.resolution
    ranges = np.empty((_POSES, lidar.beams))
    reach = lidar.range_max / tables.laser.resolution
    cast_scans(tables.rays.addresses, in_cells, lidar.unit_vectors, lidar.angle_first, lidar.angle_increment, reach, ranges)
    scans = np.where(ranges < reach, ranges * tables.laser.resolution, np.inf).astype(np.float32)
    x_min, y_min, x_max, y_max = env.floor.bounds
    grid = OccupancyGrid(env.settings.occupancy, (x_min - 6.0, y_min - 6.0, x_max + 6.0, y_max + 6.0))

    def work() -> int:
        for pose, scan in zip(poses, scans, strict=True):
            grid.integrate(pose, scan, lidar)
        return _POSES

    return _rate(work, command.seconds)


def _agent_steps(command: Bench, robots: int) -> float:
    """Measure the fused step with driving robots: motion, contact, scan, scorer and map."""
    import numpy as np

    env = _prepared(command, robots)
    generator = np.random.default_rng(command.seed)
    turns = generator.uniform(-1.0, 1.0, (64, robots))
    commands = np.zeros((robots, 2))
    commands[:, 0] = env.settings.robot.cruise_speed

    def work() -> int:
        for turn in turns:
            commands[:, 1] = turn
            env.world.step(commands)
        return len(turns) * robots

    return _rate(work, command.seconds)


def _environment_steps(command: Bench, robots: int) -> float:
    import numpy as np

    env = _prepared(command, robots)
    generator = np.random.default_rng(command.seed)
    actions = [
        {agent: np.array([0.4, turn], np.float32) for agent, turn in zip(env.agents, turns, strict=True)}
        for turns in generator.uniform(-0.3, 0.3, (64, robots))
    ]

    def work() -> int:
        for action in actions:
            env.step(action)
        return len(actions)

    return _rate(work, command.seconds)
