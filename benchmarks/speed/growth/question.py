"""How time and memory grow with robots, floors and the length of episodes."""

import argparse
import json
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from lidarium.benchmarks.results_page import about, in_file, publish
from lidarium.benchmarks.speed.cases.histories import Drives, Histories, drawn_drives
from lidarium.benchmarks.speed.growth.idle_memory import IdleMemory
from lidarium.benchmarks.speed.harness.timing import Interval, median_interval, on_cores
from lidarium.benchmarks.speed.peers.catalogue import outside_versions
from lidarium.benchmarks.speed.scenes.floors import straight_floor
from lidarium.mapping.files.output import check_writable, write_json

ALLOWED_MEMORY = 1.2
MIB = 2**20
ON_MAPS = " on the maps of "


@dataclass(frozen=True, slots=True)
class Growth:
    """The times of one size besides those of the first of its group.

    `group`: what grows; `name`: this size; `working_set`: bytes of the maps and masks that the robots write to;
    `seconds`, `first`: seconds per agent step in each repeat, of this size and of the first one; `allowed`: how many
    times the first's time it may take; None if that is only told.
    """

    group: str
    name: str
    working_set: int
    seconds: list[float]
    first: list[float]
    allowed: float | None = None

    @property
    def time(self) -> Interval:
        """Seconds per agent step."""
        return median_interval(self.seconds)

    @property
    def ratio(self) -> Interval:
        """Time over that of the first size, repeat by repeat."""
        return median_interval([own / first for own, first in zip(self.seconds, self.first, strict=True)])

    @property
    def is_kept(self) -> bool | None:
        """Whether the median of the ratios is allowed; None if that is only told."""
        return None if self.allowed is None else self.ratio.median <= self.allowed


def growth_table(growths: Sequence[Growth]) -> str:
    """Write times and ratios as a markdown table."""
    rows = [
        "| what grows | size | maps and masks | time per agent step (95 % interval) | over the first (95 % "
        "interval) | allowed | kept |",
        "|---|---|---:|---|---|---|---|",
    ]
    for growth in growths:
        time, ratio = growth.time, growth.ratio
        took = f"{1e6 * time.median:.1f} us ({1e6 * time.low:.1f} to {1e6 * time.high:.1f})"
        times = f"{ratio.median:.2f} ({ratio.low:.2f} to {ratio.high:.2f})"
        allowed = "-" if growth.allowed is None else f"<= {growth.allowed:g}"
        kept = {True: "yes", False: "no", None: "-"}[growth.is_kept]
        used = f"{growth.working_set / MIB:.1f} MiB"
        rows.append(f"| {growth.group} | {growth.name} | {used} | {took} | {times} | {allowed} | {kept} |")
    return "\n".join(rows)


def memory_ratios(memory: IdleMemory) -> dict[str, tuple[float, float | None]]:
    """Return what a robot that stands still takes, over its map, and what is allowed."""
    ratios: dict[str, tuple[float, float | None]] = {
        "arrays that belong to the robot": (memory.own_bytes / memory.map_bytes, ALLOWED_MEMORY),
        "all arrays of the environment, a robot's share": (memory.all_bytes / memory.map_bytes, None),
    }
    if memory.resident_bytes is not None:
        ratios["growth of the process (resident)"] = (memory.resident_bytes / memory.map_bytes, ALLOWED_MEMORY)
    return ratios


def memory_table(memory: IdleMemory) -> str:
    """Write the memory of a robot that stands still as a markdown table."""
    rows = ["| memory of an idle robot | over its map | allowed | kept |", "|---|---|---|---|"]
    for name, (ratio, limit) in memory_ratios(memory).items():
        wanted, kept = ("-", "-") if limit is None else (f"<= {limit:g}", "yes" if ratio <= limit else "no")
        rows.append(f"| {name} | {ratio:.2f} | {wanted} | {kept} |")
    return "\n".join(rows)


def caches() -> str:
    """Say which caches the first core has, as far as the system tells."""
    found = []
    for folder in sorted(Path("/sys/devices/system/cpu/cpu0/cache").glob("index*")):
        try:
            level, kind, size = ((folder / name).read_text().strip() for name in ("level", "type", "size"))
        except OSError:
            continue
        if kind != "Instruction":
            found.append(f"L{level} {size.removesuffix('K')} KiB")
    return ", ".join(found) or "caches unknown"


def growth_result(
    growths: Sequence[Growth], memory: IdleMemory, repeats: int, told: Mapping[str, Any]
) -> dict[str, Any]:
    """Return what is written to ``growth.json``. ``told`` is what ``report.about`` tells."""
    rows = [
        {
            "group": growth.group,
            "name": growth.name,
            "working_set": growth.working_set,
            "seconds": growth.seconds,
            "time": asdict(growth.time),
            "ratio": asdict(growth.ratio),
            "allowed": growth.allowed,
            "is_kept": growth.is_kept,
        }
        for growth in growths
    ]
    return {**told, "repeats": repeats, "caches": caches(), "growth": rows, "memory": asdict(memory)}


def growth_page(result: Mapping[str, Any], growths: Sequence[Growth], memory: IdleMemory) -> str:
    """Write the page of growth; ``result`` is that of ``growth_result``."""
    return "\n".join(
        [
            "# Growth",
            f"One thread. {result['repeats']} repeats in which all sizes run in turn; medians with 95 % intervals of "
            f"ranks. The first of a group has {SIZES[0]} robots, or a side of 13 m. Caches of a core: "
            f"{result['caches']}.",
            "",
            growth_table([growth for growth in growths if growth.allowed is not None or ON_MAPS in growth.name]),
            "",
            "All sizes:",
            "",
            in_file(growth_table(growths)),
            "",
            "- *Robots in a batch*: the same 1,024 drives of 1 s (teams of two, 720 noisy beams over 240 deg to 5.6 "
            "m, floor of 512 x 512 cells of 2.5 cm) in batches of 4, 16 and so on, one after the other on the same "
            "maps. A step is `KinematicWorld.step` with motion, contact, scans, scorer and maps.",
            "- *On the maps of 4*: the same batch of 1,024 robots with the maps and masks of the first four. The "
            "arithmetic is the same; the difference is the cost of memory.",
            "- *Side of the floor*: 256 drives of 5 s, four robots at a time, each alone on its floor.",
            "",
            memory_table(memory),
            "",
            f"- *Idle robot*: {memory.robots:,} robots in teams of two after a second without motion at the level of "
            f"velocities; the map of one has {memory.map_bytes / MIB:.2f} MiB. *Arrays that belong to the robot* are "
            "its map, its mask (an eighth of the map) and its rows of all tables; *all arrays* adds the team's masks "
            "and two sets of observations.",
            "",
        ]
    )


REPEATS = 15
SIZES = (4, 16, 64, 256, 1024)
TEAM, ROBOT_STEPS = 2, 10
SIDES, ALONE, FLOOR_DRIVES, FLOOR_STEPS = (512, 1000, 2000, 4000), 4, 256, 50
"""Sides of the floors [cells of 2.5 cm], and how many robots drive there. Each robot is alone on the floor."""

ALLOWED_TO_64, ALLOWED_TO_1024, ALLOWED_FLOORS = 1.25, {0.025: 1.8, 0.05: 1.4}, 1.25


def repeated_in_turn(histories: dict[str, Histories], repeats: int) -> dict[str, list[float]]:
    """Run all in turn that many times, after once to warm up. Seconds per agent step of each."""
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
    shared = f"{sizes[-1]:,} robots{ON_MAPS}{sizes[0]}"
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
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=REPEATS, help=f"interleaved repeats ({REPEATS})")
    parser.add_argument("--out", type=Path, help="folder of growth.md and growth.json")
    chosen = parser.parse_args()
    if chosen.out is not None:
        check_writable(chosen.out)
    with on_cores(1):
        drives = drawn_drives(straight_floor(), max(SIZES), TEAM, ROBOT_STEPS)
        growths: list[Growth] = []
        for resolution, limit in ALLOWED_TO_1024.items():
            growths += growth_with_robots(drives, resolution, SIZES, chosen.repeats, {64: ALLOWED_TO_64, 1024: limit})
        growths += growth_with_floors(repeats=chosen.repeats)
        memory = memory_of_idle_robots()
    print(growth_table(growths), memory_table(memory), sep="\n\n")
    if chosen.out is not None:
        command = f"python benchmarks/speed/growth/question.py --repeats {chosen.repeats} --out {chosen.out}"
        result = growth_result(growths, memory, chosen.repeats, about(command, outside_versions()))
        chosen.out.mkdir(parents=True, exist_ok=True)
        publish(chosen.out / "growth.md", growth_page(result, growths, memory), result)
        write_json(chosen.out / "growth.json", result)


if __name__ == "__main__":
    main()
