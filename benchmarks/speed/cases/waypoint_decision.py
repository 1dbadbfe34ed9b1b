"""Decisions by waypoints of a batch, planning included.

They stand beside as many bare steps of the same robots.

One batch takes decisions. Before each, the robots of a second batch are put where those of the first are, and
after it their kernel takes as many steps as each decision took, at the speeds and turn rates that the robots
of the first batch had on average.
"""

import math
import time

import numpy as np
from numpy.typing import NDArray

import lidarium
from lidarium.benchmarks.speed.harness.batches import EPISODES, OBSERVED, ROBOTS, can_use
from lidarium.benchmarks.speed.harness.lines import Line, needs_threads, within
from lidarium.benchmarks.speed.harness.report import run_alone
from lidarium.benchmarks.speed.harness.timing import Effort
from lidarium.benchmarks.speed.scenes.floors import straight_floor
from lidarium.benchmarks.speed.scenes.teams import LIDAR
from lidarium.envs.onboard.radio.messages import DriveState
from lidarium.mapping.grids.occupancy import three_levels

CORES = 2
ALLOWED = 1.25
NEAREST, FARTHEST = 0.5, 3.0
"""How far off waypoints are drawn [m]."""

_TRIALS, _LONGEST, _FREE = 64, 10, 255
_WITHOUT_WORK = (DriveState.IDLE, DriveState.ARRIVED, DriveState.NO_PATH)

NOTES = (
    f"*Waypoint decision*: level `waypoint`, {EPISODES} episodes of {ROBOTS} robots as in the *batch*, decisions of at "
    f"most 2 s (20 steps) to free cells {NEAREST:g} to {FARTHEST:g} m off; every robot plans anew in every decision. "
    "*Bare steps* are as many calls of `KinematicWorld.step` at the same places and mean speeds. Times are per robot "
    "and step.",
)


class Deciders:
    """A batch that drives between waypoints, and its shadow of bare steps. The shadow takes the same steps."""

    def __init__(self, threads: int) -> None:
        floor = straight_floor()
        options = {
            "lidar": LIDAR,
            "resolution": floor.resolution,
            "horizon_s": None,
            "stop_coverage": None,
            "observe": OBSERVED,
        }
        self._deciding, self._bare = (
            lidarium.vector_env(
                EPISODES, floor.floor(), level=level, robots=ROBOTS, threads=threads, copy=False, **options
            )
            for level in ("waypoint", "velocity")
        )
        settings = self._deciding.settings
        self._half_side = 0.5 * settings.map_cells * settings.occupancy.resolution
        self._steps, self._time_step = settings.decision_steps, settings.time_step
        self._starts = 0

    def start(self) -> None:
        """Begin anew at other places, with blank maps and no waypoints."""
        for env in (self._deciding, self._bare):
            env.reset(seed=1000 * self._starts)
        self._generator = np.random.default_rng(self._starts)
        self._starts = (self._starts + 1) % 8
        rows = EPISODES * ROBOTS
        self._waypoints, self._ages, self._is_idle = (
            np.zeros((rows, 2)),
            np.zeros(rows, np.int64),
            np.ones(rows, np.bool_),
        )

    def run(self, seconds: float) -> tuple[float, float]:
        """Decide and take bare steps for about so long each. Seconds per robot and step of both."""
        simulation, bare = self._deciding.engine.simulation, self._bare.engine.simulation
        deciding, stepping, agent_steps = 0.0, 0.0, 0
        while agent_steps == 0 or deciding + stepping < 2.0 * seconds:
            actions = self._actions()
            bare.world.poses[:], bare.world.velocities[:] = (simulation.world.poses, simulation.world.velocities)
            bare.beliefs.believed[:] = simulation.beliefs.believed
            poses, steps, travelled = (
                simulation.world.poses.copy(),
                simulation.world.steps.copy(),
                simulation.world.travelled.copy(),
            )
            began = time.perf_counter()
            *_, infos = self._deciding.step(actions)
            deciding += time.perf_counter() - began
            taken = simulation.world.steps - steps
            duration = np.repeat(taken, ROBOTS) * self._time_step
            turned = np.mod(simulation.world.poses[:, 2] - poses[:, 2] + math.pi, 2.0 * math.pi) - math.pi
            commands = np.column_stack([(simulation.world.travelled - travelled) / duration, turned / duration])
            runs = [taken > step for step in range(int(taken.max()))]
            began = time.perf_counter()
            for running in runs:
                bare.step(commands, runs=running)
            stepping += time.perf_counter() - began
            agent_steps += ROBOTS * int(taken.sum())
            self._is_idle = np.array([state in _WITHOUT_WORK for state in infos["drive"]])
        return deciding / agent_steps, stepping / agent_steps

    def _actions(self) -> NDArray[np.float32]:
        """Give robots without a waypoint another one, and return all waypoints.

        They are shares of half the observed map's side.
        """
        simulation = self._deciding.engine.simulation
        places = simulation.beliefs.believed[:, :2]
        self._ages += 1
        for row in np.flatnonzero(self._is_idle | (self._ages > _LONGEST)):
            self._waypoints[row], self._ages[row] = self._drawn(int(row)), 0
        shares = (self._waypoints - places) / self._half_side
        return np.clip(shares, -1.0, 1.0).astype(np.float32)

    def _drawn(self, row: int) -> NDArray[np.float64]:
        """Draw a place [m] that the robot knows to be free. Where it stands, if none of many draws is."""
        simulation = self._deciding.engine.simulation
        angles, distances = (
            self._generator.uniform(-math.pi, math.pi, _TRIALS),
            self._generator.uniform(NEAREST, FARTHEST, _TRIALS),
        )
        places = simulation.beliefs.believed[row, :2] + distances[:, None] * np.column_stack(
            [np.cos(angles), np.sin(angles)]
        )
        cells = np.floor((places - simulation.beliefs.origins[row]) / simulation.occupancy.resolution).astype(np.int64)
        log_odds = simulation.beliefs.log_odds[row]
        inside = (cells >= 0).all(axis=1) & (cells < log_odds.shape[::-1]).all(axis=1)
        levels = three_levels(log_odds[cells[inside, 1], cells[inside, 0]])
        free = places[inside][levels == _FREE]
        return np.asarray(free[0] if len(free) else simulation.beliefs.believed[row, :2])


def measure(effort: Effort) -> list[Line]:
    """Compare the time of decisions with that of their steps."""
    title = f"waypoint decision of 2 s, {EPISODES} episodes x {ROBOTS} robots, two threads"
    if not can_use(CORES):
        return [needs_threads(title, ALLOWED, is_upper_bound=True)]
    deciders = Deciders(CORES)
    deciders.start()
    deciders.run(0.0)
    rounds = []
    for turn in range(effort.rounds):
        if turn % 3 == 0:
            deciders.start()
        rounds.append(deciders.run(effort.block_s))
    deciding, stepping = zip(*rounds, strict=True)
    return [within(title, deciding, "bare steps", stepping, ALLOWED)]


if __name__ == "__main__":
    run_alone(measure, "Decisions by waypoints beside bare steps.", CORES)
