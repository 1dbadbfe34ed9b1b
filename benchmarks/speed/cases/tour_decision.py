"""Plans of `tour_frontier` and `predicted_tours`, and decisions of a batch at the level of tours.

A plan gives all robots of a team their next goals; a decision is that of a robot that has several stops to choose from.
"""

import statistics
import time
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

import lidarium
from lidarium.agents.frontier.reach import Choice
from lidarium.agents.predicted.policy import PredictedTours
from lidarium.agents.tours.policy import TourFrontier
from lidarium.benchmarks.speed.cases.learners.masked_training import Learner, is_there, timings
from lidarium.benchmarks.speed.harness.lines import Line, shown
from lidarium.benchmarks.speed.harness.report import run_alone
from lidarium.benchmarks.speed.harness.timing import Effort
from lidarium.extras import install_command

CORES = 2
ROBOTS, EPISODES, FLOORS = 2, 32, "set:validation"
WARM_STEPS = 25
ROLLOUT, BATCH, EPOCHS = 32, 512, 3
OPTIONS: dict[str, Any] = {"resolution": 0.05, "stop_coverage": 0.99, "horizon_s": 1800.0}
MOST_MS, MOST_PREDICTED_MS, TO_REACH = 1.2, 20.0, 800.0

NOTES = (
    f"*Plan of tours*: all that `tour_frontier` does to choose goals for {ROBOTS} robots, over whole episodes on "
    f"`{FLOORS}`, in CPU time; *plan of predicted tours*: that of `predicted_tours` for one robot. *Tour decisions*: "
    f"level `tour`, {EPISODES} episodes, two threads; choices are drawn with equal probability, and robots that "
    "continue to their stop are not counted. *Training on tours*: `MaskablePPO` with the network and world of "
    "`lidarium train tours-2`, by the clock; robots that continue to their stop are counted.",
)


def plan_seconds(kind: type[TourFrontier], robots: int, floors: int) -> float:
    """Return the mean time of a policy's plan over some floors [s]; the first one warms up."""
    seconds: list[float] = []

    class Timed(kind):  # type: ignore[misc, valid-type]
        def choose(self, agents: list[str], open_agents: list[str]) -> dict[str, Choice | None]:
            began = time.process_time()
            chosen: dict[str, Choice | None] = super().choose(agents, open_agents)
            seconds.append(time.process_time() - began)
            return chosen

    policy = Timed()
    for number, floor in enumerate(lidarium.floor_set(f"{FLOORS}:{floors + 1}")):
        lidarium.run_episode(policy, lidarium.parallel_env(floor, robots=robots, **OPTIONS), seed=0)
        if number == 0:
            seconds.clear()
    return statistics.mean(seconds)


def decisions_a_second(seconds: float) -> float:
    """Return how many decisions of a batch at the level of tours are made in a second of the clock."""
    envs = lidarium.vector_env(EPISODES, FLOORS, level="tour", threads=2, copy=False, robots=ROBOTS, **OPTIONS)
    generator = np.random.default_rng(0)
    mask = envs.reset(seed=0)[0]["action_mask"]
    count, step, began = 0, 0, 0.0
    while step <= WARM_STEPS or time.perf_counter() - began < seconds:
        if step == WARM_STEPS:
            count, began = 0, time.perf_counter()
        chances = generator.random(mask.shape) * mask
        chances[:, -1] *= 1e-6  # to stay only if nothing is offered
        count += int((mask[:, :-1].sum(axis=1) > 1).sum())
        mask, step = envs.step(chances.argmax(axis=1))[0]["action_mask"], step + 1
    return count / (time.perf_counter() - began)


def measure(effort: Effort) -> list[Line]:
    """Measure plans of a team, and decisions at the level of tours."""
    rate = statistics.median(decisions_a_second(4.0 * effort.block_s) for _ in range(effort.rounds))
    return [
        _plans(f"plan of tours, {ROBOTS} robots", TourFrontier, ROBOTS, MOST_MS, effort),
        _plans("plan of predicted tours, one robot", PredictedTours, 1, MOST_PREDICTED_MS, effort),
        Line("tour decisions, two cores", f"{shown(rate)} decisions/s", "-", None, TO_REACH, rate, unit="decisions/s"),
        _training(effort),
    ]


def _training(effort: Effort) -> Line:
    name, unit = "training on tours, two cores", "decisions/s"
    if not is_there():
        return Line(name, "-", f"not measured: {install_command('rl')}", None, TO_REACH, unit=unit)
    from lidarium.training.reinforcement.frontier_policy import TourPolicy
    from lidarium.training.settings import TeamSettings, read_any_training

    team = read_any_training(Path(str(resources.files("lidarium.training.teams") / "data" / "tours-2.toml")))
    assert isinstance(team, TeamSettings)
    world = {"level": team.level, "threads": 2, **team.options(team.realism)}
    learner = Learner(TourPolicy, EPISODES // ROBOTS, ROLLOUT, BATCH, EPOCHS, team.floors, world=world)
    rate = statistics.median(rate for rate, _ in timings(learner, effort.rounds))
    return Line(name, f"{shown(rate)} {unit}", "-", None, TO_REACH, rate, unit=unit)


def _plans(name: str, kind: type[TourFrontier], robots: int, most_ms: float, effort: Effort) -> Line:
    found = 1e3 * min(plan_seconds(kind, robots, 3) for _ in range(effort.rounds))
    return Line(name, f"{found:.2f} ms", "-", None, most_ms, found, is_upper_bound=True, unit="ms")


if __name__ == "__main__":
    run_alone(measure, "Plans of tours, and decisions at their level.", CORES)
