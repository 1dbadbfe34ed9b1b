"""Whole steps of a batch on two threads.

They stand beside one thread and besides the kernel alone.

Three batches are in the same state and take the same steps, some at a time in turn: one takes whole steps on
two threads, one on one thread, and of the third the kernel alone runs on two threads.
"""

import time
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from lidarium.benchmarks.speed.harness.batches import EPISODES, ROBOTS, DrivenBatch, can_use
from lidarium.benchmarks.speed.harness.lines import Line, faster, needs_threads, shown, within
from lidarium.benchmarks.speed.harness.report import run_alone
from lidarium.benchmarks.speed.harness.timing import Effort, rate
from lidarium.benchmarks.speed.scenes.floors import straight_floor
from lidarium.benchmarks.speed.scenes.teams import HOLD, LIDAR

CORES = 2
LEAST_GAIN, ALLOWED, LEAST_RATE = 1.8, 1.3, 30_000.0

NOTES = (
    f"*Batch*: `lidarium.vector_env` with {EPISODES} episodes of {ROBOTS} robots, floor, laser and maps as in the "
    "*kernel step*; observations are scan, pose, velocity, bumper, and egocentric maps of 64 x 64 cells at the scales "
    "1 and 4. *Kernel alone* is the kernel of that step.",
)


def run_in_turn(steps: Mapping[str, Callable[[], object]], seconds: float) -> dict[str, float]:
    """Run the same number of steps of each, alternately, and time them.

    Blocks of ``HOLD`` steps alternate, for about so long each; returned are the seconds per step of each.
    """
    spent = dict.fromkeys(steps, 0.0)
    count = 0
    while count == 0 or sum(spent.values()) < seconds * len(steps):
        for name, step in steps.items():
            began = time.perf_counter()
            for _ in range(HOLD):
                step()
            spent[name] += time.perf_counter() - began
        count += HOLD
    return {name: total / count for name, total in spent.items()}


def measure(effort: Effort) -> list[Line]:
    """Compare the whole step on two threads with that on one, and with the kernel."""
    title = f"batch of {EPISODES} episodes x {ROBOTS} robots, two threads"
    if not can_use(CORES):
        return [needs_threads(title, LEAST_GAIN)]
    floor = straight_floor()
    options: dict[str, Any] = {"lidar": LIDAR, "resolution": floor.resolution}
    batches = {
        name: DrivenBatch(floor, threads, **options) for name, threads in (("two", 2), ("one", 1), ("kernel", 2))
    }
    steps = {"two": batches["two"].step, "one": batches["one"].step, "kernel": batches["kernel"].step_kernel}
    seconds: dict[str, list[float]] = {name: [] for name in steps}
    for turn in range(-1, effort.rounds):
        for batch in batches.values():
            batch.start(turn % 8)
        taken = run_in_turn(steps, effort.block_s if turn >= 0 else 0.0)
        if not all(np.array_equal(batch.poses, batches["two"].poses) for batch in batches.values()):
            raise RuntimeError("the batches are not in the same state; their times cannot be compared")
        if turn >= 0:
            for name, value in taken.items():
                seconds[name].append(value / (EPISODES * ROBOTS))
    two = seconds["two"]
    return [
        faster(title, two, "one thread", seconds["one"], LEAST_GAIN),
        within(title, two, "kernel alone", seconds["kernel"], ALLOWED),
        Line(
            f"{title}, rate on this machine",
            f"{shown(rate(two))} agent steps/s",
            "-",
            None,
            LEAST_RATE,
            rate(two),
            unit="/s",
        ),
    ]


if __name__ == "__main__":
    run_alone(measure, "Whole steps of a batch on two threads.", CORES)
