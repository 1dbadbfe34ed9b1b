"""How much memory a robot takes that stands still, besides that of its map.

python benchmarks/speed/growth/idle_memory.py
"""

import gc
import json
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from lidarium.benchmarks.speed.harness.batches import OBSERVED, ROBOTS
from lidarium.benchmarks.speed.harness.memory import resident
from lidarium.benchmarks.speed.scenes.floors import straight_floor
from lidarium.benchmarks.speed.scenes.teams import LIDAR
from lidarium.envs.faces.vector_env import ExplorationVectorEnv
from lidarium.envs.simulation.simulation import Simulation


@dataclass(frozen=True, slots=True)
class IdleMemory:
    """Memory of a robot that stands still at the level of velocities.

    `robots`: how many stood there; `map_bytes`: of the robot's map; `own_bytes`: of all arrays that belong to the
    robot: map, mask, scan, poses and so on; `all_bytes`: of all arrays of the environment, by the number of robots: the
    team's masks and the observations' buffers, too; `resident_bytes`: by how much a robot makes the process grow, as
    the system tells; None if it does not.
    """

    robots: int
    map_bytes: int
    own_bytes: float
    all_bytes: float
    resident_bytes: float | None


def own_bytes(simulation: Simulation) -> float:
    """Return the mean size of the arrays that belong to a robot.

    It counts arrays over rows, and the robot's map and mask.
    """
    rows = simulation.robots * simulation.episodes
    over_rows = sum(
        array.nbytes
        for owner in (simulation.world, simulation.beliefs, simulation.score)
        for array in vars(owner).values()
        if isinstance(array, np.ndarray) and len(array) == rows
    )
    grids = sum(array.nbytes for array in simulation.beliefs.log_odds) + sum(
        array.nbytes for array in simulation.score.masks
    )
    return (over_rows + grids) / rows


def array_bytes(thing: Any) -> int:  # noqa: ANN401
    """Return the size of all arrays that an object holds.

    Arrays count once, held directly or through what the object is made of.
    """
    seen: set[int] = set()
    pending: list[Any] = [thing]
    total = 0
    while pending:
        each = pending.pop()
        while isinstance(each, np.ndarray) and isinstance(each.base, np.ndarray):
            each = each.base
        if id(each) in seen or isinstance(each, type) or callable(each):
            continue
        seen.add(id(each))
        if isinstance(each, np.ndarray):
            total += each.nbytes
        elif isinstance(each, dict | list | tuple) or type(each).__module__.startswith("lidarium."):
            pending += gc.get_referents(each)
    return total


def standing(robots: int) -> ExplorationVectorEnv:
    """Return an environment in which that many robots stood still for a second.

    They are in teams on the straight floor.
    """
    floor = straight_floor()
    env = ExplorationVectorEnv(
        robots // ROBOTS,
        floor.floor(),
        robots=ROBOTS,
        lidar=LIDAR,
        resolution=floor.resolution,
        observe=OBSERVED,
        threads=1,
        copy=False,
    )
    env.reset(seed=0)
    for _ in range(10):
        env.step(np.zeros((robots, 2), np.float32))
    return env


def measure(few: int = 64, many: int = 1024) -> IdleMemory:
    """Measure what the robots of a batch of ``many`` take after one of ``few``.

    A fresh process gives the truest figure.
    """
    first = standing(few)
    gc.collect()
    before = resident()
    second = standing(many)
    gc.collect()
    after = resident()
    simulation = second.engine.simulation
    growth = None if before is None or after is None else (after - before) / many
    # What does not grow with the robots, such as the floor's tables, drops out of the difference.
    everything = (array_bytes(second) - array_bytes(first)) / (many - few)
    return IdleMemory(many, simulation.beliefs.log_odds[0].nbytes, own_bytes(simulation), everything, growth)


if __name__ == "__main__":
    print(json.dumps(asdict(measure())))
