"""Growth of an agent step's time and a robot's memory.

They grow with the robots of a batch and with the size of the floor.

    python benchmarks/speed/growth/question.py                      # prints the tables
    python benchmarks/speed/growth/question.py --out docs/results   # and writes growth.md and growth.json

The same short drives are run in batches of every size, so that batches differ in the memory that they use and
in nothing else.
"""

import argparse
import json
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from lidarium.benchmarks.speed.cases.histories import Drives, Histories, drawn_drives
from lidarium.benchmarks.speed.growth.idle_memory import IdleMemory
from lidarium.benchmarks.speed.growth.report import (
    Growth,
    growth_page,
    growth_result,
    growth_table,
    memory_table,
)
from lidarium.benchmarks.speed.harness.report import about
from lidarium.benchmarks.speed.harness.timing import on_cores
from lidarium.benchmarks.speed.scenes.floors import straight_floor
from lidarium.mapping.files.output import check_writable, write_json, write_text

REPEATS = 15
SIZES = (4, 16, 64, 256, 1024)
TEAM, ROBOT_STEPS = 2, 10
SIDES, ALONE, FLOOR_DRIVES, FLOOR_STEPS = (512, 1000, 2000, 4000), 4, 256, 50
"""Sides of the floors [cells of 2.5 cm], and how many robots drive there.

Each robot is alone on the floor.
"""

ALLOWED_TO_64, ALLOWED_TO_1024, ALLOWED_FLOORS = 1.25, {0.025: 1.8, 0.05: 1.4}, 1.25


def repeated_in_turn(histories: dict[str, Histories], repeats: int) -> dict[str, list[float]]:
    """Run all in turn so many times, after once to warm up.

    Seconds per agent step of each.
    """
    for history in histories.values():
        history.run()
    seconds: dict[str, list[float]] = {name: [] for name in histories}
    for _ in range(repeats):
        for name, history in histories.items():
            seconds[name].append(history.run())
    return seconds


def growth_with_robots(
    drives: Drives,
    resolution: float,
    sizes: Sequence[int] = SIZES,
    repeats: int = REPEATS,
    allowed: dict[int, float] | None = None,
) -> list[Growth]:
    """Measure batches of different sizes.

    The largest is measured once more with all its robots on the maps of the smallest one.
    """
    histories = {f"{size:,} robots": Histories(drives, size, resolution) for size in sizes}
    shared = f"{sizes[-1]:,} robots on the maps of {sizes[0]}"
    histories[shared] = Histories(drives, sizes[-1], resolution, maps=sizes[0])
    seconds = repeated_in_turn(histories, repeats)
    first = next(iter(seconds.values()))
    limits = [(allowed or {}).get(size) for size in sizes] + [None]
    group = f"robots in a batch, maps of {resolution:g} m"
    return [
        Growth(group, name, histories[name].working_set, seconds[name], first, limit)
        for name, limit in zip(histories, limits, strict=True)
    ]


def growth_with_floors(
    sides: Sequence[int] = SIDES, drives: int = FLOOR_DRIVES, repeats: int = REPEATS
) -> list[Growth]:
    """Measure the same number of robots on floors of different sizes."""
    histories = {}
    for side in sides:
        floor = straight_floor(side, side)
        histories[f"{side * floor.resolution:.0f} m"] = Histories(
            drawn_drives(floor, drives, 1, FLOOR_STEPS), ALONE, floor.resolution
        )
    seconds = repeated_in_turn(histories, repeats)
    first = next(iter(seconds.values()))
    limits = [None] * (len(sides) - 1) + [ALLOWED_FLOORS]
    return [
        Growth("side of the floor", name, history.working_set, seconds[name], first, limit)
        for (name, history), limit in zip(histories.items(), limits, strict=True)
    ]


def memory_of_idle_robots() -> IdleMemory:
    """Measure it in a fresh process."""
    program = Path(__file__).with_name("idle_memory.py")
    told = subprocess.run([sys.executable, str(program)], capture_output=True, text=True, check=True).stdout
    return IdleMemory(**json.loads(told.splitlines()[-1]))


def main() -> None:
    """Measure, print, and write where asked to."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--repeats", type=int, default=REPEATS, help=f"interleaved repeats ({REPEATS})")
    parser.add_argument("--out", type=Path, help="folder of growth.md and growth.json")
    chosen = parser.parse_args()
    if chosen.out is not None:
        check_writable(chosen.out)
    with on_cores(1):
        drives = drawn_drives(straight_floor(), max(SIZES), TEAM, ROBOT_STEPS)
        growths: list[Growth] = []
        for resolution, limit in ALLOWED_TO_1024.items():
            growths += growth_with_robots(
                drives, resolution, SIZES, chosen.repeats, {64: ALLOWED_TO_64, 1024: limit}
            )
        growths += growth_with_floors(repeats=chosen.repeats)
        memory = memory_of_idle_robots()
    print(growth_table(growths), memory_table(memory), sep="\n\n")
    if chosen.out is not None:
        command = f"python benchmarks/speed/growth/question.py --repeats {chosen.repeats} --out {chosen.out}"
        result = growth_result(growths, memory, chosen.repeats, about(command))
        chosen.out.mkdir(parents=True, exist_ok=True)
        write_text(chosen.out / "growth.md", growth_page(result, growths, memory))
        write_json(chosen.out / "growth.json", result)


if __name__ == "__main__":
    main()
