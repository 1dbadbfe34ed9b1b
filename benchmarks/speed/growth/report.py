"""The tables and the page of growth."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from lidarium.benchmarks.speed.growth.idle_memory import IdleMemory
from lidarium.benchmarks.speed.harness.report import heading
from lidarium.benchmarks.speed.harness.timing import Interval, median_interval

ALLOWED_MEMORY = 1.2
MIB = 2**20


@dataclass(frozen=True, slots=True)
class Growth:
    """The times of one size beside those of the first of its group.

    Attributes
    ----------
    group : str
        What grows.
    name : str
        This size.
    working_set : int
        Bytes of the maps and masks that the robots write to.
    seconds, first : list of float
        Seconds per agent step in each repeat, of this size and of the first one.
    allowed : float or None
        How many times the first's time it may take; None where that is only told.
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
        """Whether the median of the ratios is allowed; None where that is only told."""
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
        ratios["growth of the process (resident)"] = (
            memory.resident_bytes / memory.map_bytes,
            ALLOWED_MEMORY,
        )
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
    """Return what is written to ``growth.json``.

    ``told`` is what ``report.about`` tells.
    """
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
            *heading("Growth", result),
            f"One thread. {result['repeats']} repeats in which all sizes run in turn; medians, with the "
            "interval of ranks that holds the "
            f"true median in at least 95 of 100 cases. Caches of a core: {result['caches']}.",
            "",
            growth_table(growths),
            "",
            "- *Robots in a batch*: the same 1,024 drives of 1 s (teams of two, 720 noisy beams over 240 deg "
            "to 5.6 m, the straight floor "
            "of 512 x 512 cells of 2.5 cm) are run in batches of 4, of 16 and so on: batch after batch is "
            "put where its drives begin, on "
            "the maps that it has. A step is `KinematicWorld.step` with motion, contact, scans, scorer and "
            "maps.",
            "- *On the maps of 4*: the same batch of 1,024 robots, whose maps and masks are those of the "
            "first four. The arithmetic "
            "is the same, cell for cell; only the memory in use is smaller. What the time falls by is what "
            "memory costs.",
            "- *Side of the floor*: 256 drives of 5 s on floors of the same kind of rooms, four robots at a "
            "time, each alone on its floor.",
            "",
            memory_table(memory),
            "",
            f"- *Idle robot*: {memory.robots:,} robots in teams of two that have stood still for a second at "
            "the level of velocities, on "
            f"the straight floor; the map of one has {memory.map_bytes / MIB:.2f} MiB. *Arrays that belong "
            "to the robot* are its map, its "
            "mask (an eighth of the map) and its rows of all tables; *all arrays* adds the team's masks and "
            "two sets of observations. "
            "*Resident* is what the process has grown by, with what the C library keeps between arrays.",
            "",
        ]
    )
