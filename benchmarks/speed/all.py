"""All questions of speed in one go: the table of the speed budget.

    python benchmarks/speed/all.py                  # writes docs/results/speed.md and speed.json
    python benchmarks/speed/all.py --effort quick

``lidarium bench`` measures the same. The peers take part if they are installed, see
``peers/catalogue.py``.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

from lidarium.benchmarks.speed.cases import (
    batch_step,
    cached_start,
    environment_step,
    exploration_projects,
    frontier_decision,
    kernel_step,
    learning_preset,
    map_update,
    predicted_window,
    range_error,
    ray_casting,
    thread_scaling,
    tour_decision,
    waypoint_decision,
)
from lidarium.benchmarks.speed.cases.learners import (
    attention_training,
    batch_memory,
    first_reset,
    frontier_threads,
    learned_training,
    masked_training,
)
from lidarium.benchmarks.speed.cases.three_dimensions import (
    bullet_world,
    depth_image,
    path_server,
    quantisation,
    sparse_planning,
)
from lidarium.benchmarks.speed.harness.lines import Line, table
from lidarium.benchmarks.speed.harness.report import speed_result, with_effort, write_speed
from lidarium.benchmarks.speed.harness.timing import EFFORTS, Effort, on_cores
from lidarium.benchmarks.speed.peers.catalogue import missing_peers

_MODULES: tuple[ModuleType, ...] = (
    kernel_step,
    ray_casting,
    range_error,
    map_update,
    exploration_projects,
    environment_step,
    batch_step,
    thread_scaling,
    learning_preset,
    waypoint_decision,
    frontier_decision,
    tour_decision,
    predicted_window,
    frontier_threads,
    masked_training,
    attention_training,
    learned_training,
    batch_memory,
    first_reset,
    bullet_world,
    cached_start,
    depth_image,
    quantisation,
    sparse_planning,
    path_server,
)

QUESTIONS: dict[str, Any] = {module.__name__.split(".")[-1]: module for module in _MODULES}
"""The questions by name. They are modules with ``CORES``, ``NOTES`` and ``measure(effort)``."""

ABOUT_QUOTES = ("*quoted*: not measured in this run but on an AMD Zen 5 core of about 4.1 GHz.",)


def ask(name: str, effort: Effort) -> list[Line]:
    """Measure the lines of a question, on as many cores as it is about."""
    question = QUESTIONS[name]
    with on_cores(question.CORES):
        lines: list[Line] = question.measure(effort)
    return lines


def result_of(names: Sequence[str], lines: Sequence[Line], command: str, effort: Effort) -> dict[str, Any]:
    """Return the result of questions. It holds their lines, what explains them, and which peers were left out."""
    notes = [note for name in names for note in QUESTIONS[name].NOTES]
    return speed_result(lines, command, effort, [*notes, *ABOUT_QUOTES, *missing_peers()])


def main() -> None:
    """Measure, print and write."""
    parser = with_effort(argparse.ArgumentParser(description="All speed benchmarks in one run."))
    parser.add_argument("--out", type=Path, default=Path("docs/results"), help="folder of speed.md and speed.json")
    chosen = parser.parse_args()
    effort = EFFORTS[chosen.effort]
    lines: list[Line] = []
    for name in QUESTIONS:
        found = ask(name, effort)
        print(f"{name}\n\n{table(found)}\n", flush=True)
        lines += found
    command = f"python benchmarks/speed/all.py --effort {chosen.effort}"
    write_speed(result_of(list(QUESTIONS), lines, command, effort), lines, chosen.out)
    missed = [line.name for line in lines if line.is_reached is False]
    print(f"{len(lines)} lines written to {chosen.out}/speed.md and speed.json; not reached: {len(missed)}")


if __name__ == "__main__":
    main()
