"""Speed of batches on 2, 4, 8 and more threads over one: steps of the learning preset, and frontier decisions."""

from collections.abc import Callable

from lidarium.benchmarks.speed.cases.batch_step import run_in_turn
from lidarium.benchmarks.speed.cases.frontier_decision import Choosers
from lidarium.benchmarks.speed.harness.batches import ROBOTS, DrivenBatch, can_use
from lidarium.benchmarks.speed.harness.lines import Line, faster, needs_threads
from lidarium.benchmarks.speed.harness.report import run_alone
from lidarium.benchmarks.speed.harness.timing import Effort, cores
from lidarium.benchmarks.speed.scenes.floors import straight_floor

CORES = len(cores())
EPISODES, CHOOSING = 256, 64
FLOORS = "set:validation:8"
"""Few, so that all are in memory: else who comes first reads them for all."""

TO_REACH = {16: 11.0}

NOTES = (
    f"*Thread scaling*: the learning preset with {EPISODES} episodes of {ROBOTS} robots, and decisions of {CHOOSING} "
    f"episodes of one robot on `{FLOORS}`, else as for *frontier decision*, by the clock. All numbers of threads take "
    "the same steps in turn.",
)


def _lines(title: str, steps: dict[int, Callable[[], object]], rows: int, effort: Effort, unit: str) -> list[Line]:
    """Return a line for each number of threads, relative to one thread."""
    named = {str(threads): step for threads, step in steps.items()}
    run_in_turn(named, 0.0)
    rounds = [run_in_turn(named, effort.block_s) for _ in range(effort.rounds)]
    seconds = {threads: [taken[str(threads)] / rows for taken in rounds] for threads in steps}
    return [
        faster(f"{title}, {threads} threads", seconds[threads], "one thread", seconds[1], TO_REACH.get(threads), unit)
        for threads in steps
        if threads > 1
    ]


def measure(effort: Effort) -> list[Line]:
    """Compare powers of two up to all cores with one thread."""
    titles = f"learning preset, {EPISODES} episodes x {ROBOTS} robots", f"frontier decisions, {CHOOSING} episodes"
    if not can_use(2):
        return [needs_threads(f"{title}, more threads", TO_REACH[16]) for title in titles]
    counts = [2**power for power in range(len(cores()).bit_length()) if can_use(2**power)]
    floor = straight_floor()
    batches = {
        threads: DrivenBatch(floor, threads, EPISODES, lidar="lidar_360_6m", resolution=0.05) for threads in counts
    }
    for batch in batches.values():
        batch.start(0)
    steps: dict[int, Callable[[], object]] = {threads: batch.step for threads, batch in batches.items()}
    lines = _lines(titles[0], steps, EPISODES * ROBOTS, effort, "agent steps/s")
    del batches, steps
    decisions: dict[int, Callable[[], object]] = {
        threads: Choosers(1, threads, FLOORS, CHOOSING).decide for threads in counts
    }
    return lines + _lines(titles[1], decisions, CHOOSING, effort, "rows/s")


if __name__ == "__main__":
    run_alone(measure, "Speed of batches on more threads over one.", CORES)
