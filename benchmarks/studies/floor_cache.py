"""Resets over the floors of set:train in several processes that share a store.

Three phases, each in fresh processes: *cold*, each process makes its share of the floors; *warm*, each loads
the floors that another one made; *held*, each loads as many floors as it has episodes and holds them. Every
reset is appended to ``resets.jsonl`` at once; a second call does what is missing.
"""

import json
import multiprocessing
import os
import platform
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from datetime import date
from pathlib import Path
from statistics import mean, median

import numpy as np

import lidarium
from lidarium.benchmarks.studies.shared.kept import Progress
from lidarium.benchmarks.studies.shared.study import Study
from lidarium.envs.exploration import ExplorationEnv
from lidarium.envs.floors.catalogue.names import load_floor, set_floors
from lidarium.envs.floors.catalogue.store import FOLDER_VARIABLE, SIZE_VARIABLE, Store
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.settings.making import make_settings
from lidarium.envs.simulation.kernels.floor_cache import floor_tables
from lidarium.mapping.files.output import write_json

FLOORS = 10_000
"""The first so many floors of the set."""

PROCESSES = 2
EPISODES = (64, 1024)
"""Floors that each process holds at once."""

STORE_MIB = 1024
ROBOTS, LIDAR = 2, "lidar_360_6m"
ASKED_FILE, LOG_FILE, STORE_FOLDER = "asked.json", "resets.jsonl", "store"
SECONDS_BETWEEN_READS = 0.5

Rows = list[dict[str, object]]


def memory() -> dict[str, float]:
    """Return how much memory this process takes, whole, private and shared [MiB].

    Empty where the system does not say.
    """
    try:
        lines = Path("/proc/self/smaps_rollup").read_text().splitlines()[1:]
    except OSError:
        return {}
    sizes = {name.rstrip(":"): int(size) / 1024.0 for name, size, *_ in map(str.split, lines)}
    private, shared = (
        sum(size for name, size in sizes.items() if name.startswith(kind)) for kind in ("Private_", "Shared_")
    )
    return {"rss_mib": sizes["Rss"], "pss_mib": sizes["Pss"], "private_mib": private, "shared_mib": shared}


def append(path: Path, row: dict[str, object]) -> None:
    """Append a line in one write, so that lines of several processes do not mix."""
    with path.open("ab", buffering=0) as lines:
        lines.write((json.dumps(row) + "\n").encode())


def reset_over(phase: str, process: int, floors: list[str], log: Path) -> None:
    """Reset an environment on each floor.

    The time of floor and tables is taken apart from that of the rest.
    """
    settings = _settings()
    env = ExplorationEnv("apartment", settings)
    env.reset(seed=0)
    for floor in floors:
        began = time.perf_counter()
        tables = floor_tables(
            load_floor(floor), settings.raster_resolution, settings.lidar.height, settings.robot.height
        )
        made = time.perf_counter()
        env.reset(seed=0, options={"floor": floor})
        ended = time.perf_counter()
        append(
            log,
            {
                "phase": phase,
                "floor": floor,
                "tables_s": made - began,
                "rest_s": ended - made,
                "tables_bytes": tables.nbytes,
            },
        )
    if floors:
        append(log, {"phase": f"{phase} memory", "process": process, **memory()})


def hold(phase: str, process: int, floors: list[str], log: Path) -> None:
    """Load the tables of some floors and hold them, as that many episodes would."""
    settings = _settings()
    heights = settings.raster_resolution, settings.lidar.height, settings.robot.height
    floor_tables(load_floor("apartment"), *heights)
    before = memory()
    held = [floor_tables(load_floor(floor), *heights) for floor in floors]
    row = {
        "phase": phase,
        "process": process,
        "episodes": len(floors),
        "tables_mib": sum(tables.nbytes for tables in held) / 2**20,
    }
    append(log, {**row, **memory(), "rss_before_mib": before.get("rss_mib", 0.0)})


def rows_of(log: Path) -> Rows:
    """Read what has been measured."""
    return [json.loads(line) for line in log.read_text().splitlines()] if log.exists() else []


def run_phase(
    work: Callable[[str, int, list[str], Path], None],
    phase: str,
    shares: list[list[str]],
    log: Path,
    total: int,
) -> Progress:
    """Run a phase in a process for each share.

    Yields how many of the ``total`` lines of the log are there.

    Raises
    ------
    RuntimeError
        Where a process has failed.
    """
    context = multiprocessing.get_context("spawn")
    processes = [context.Process(target=work, args=(phase, k, share, log)) for k, share in enumerate(shares)]
    known = len(rows_of(log))
    for process in processes:
        process.start()
    try:
        while any(process.is_alive() for process in processes):
            time.sleep(SECONDS_BETWEEN_READS)
            yield phase, min(len(rows_of(log)) - known, total), total
    finally:
        for process in processes:
            process.terminate()
            process.join()
    if any(process.exitcode for process in processes):
        raise RuntimeError(f"a process of phase {phase} failed")


def work(folder: Path, _data: Path | None, every: int, _workers: int) -> Progress:
    """Run what the log lacks, over every N-th floor.

    The number of processes is part of the study, not of the command.

    Raises
    ------
    ValueError
        Where the folder holds resets of other floors, or of another version.
    """
    floors = list(set_floors("set:train")[:FLOORS][::every])
    _check_same(folder / ASKED_FILE, floors, every)
    log = folder / LOG_FILE
    with _environment(folder / STORE_FOLDER):
        for phase, shift in (("cold", 0), ("warm", 1)):
            shares = _missing_shares(floors, phase, shift, log)
            if any(shares):
                yield from run_phase(reset_over, phase, shares, log, sum(map(len, shares)))
        for episodes in EPISODES:
            generator = np.random.default_rng(episodes)
            chosen = [
                generator.choice(len(floors), min(episodes, len(floors)), replace=False)
                for _ in range(PROCESSES)
            ]
            shares = [[floors[place] for place in places] for places in chosen]
            if not any(row["phase"] == f"held {episodes}" for row in rows_of(log)):
                yield from run_phase(hold, f"held {episodes}", shares, log, PROCESSES)


def _missing_shares(floors: list[str], phase: str, shift: int, log: Path) -> list[list[str]]:
    """Return the floors that each process has to reset on.

    They are dealt out one by one; where they are shifted, their order is drawn.
    """
    done = {row["floor"] for row in rows_of(log) if row["phase"] == phase}
    shares = [
        [floor for floor in floors[(k + shift) % PROCESSES :: PROCESSES] if floor not in done]
        for k in range(PROCESSES)
    ]
    if not shift:
        return shares
    return [
        [share[place] for place in np.random.default_rng(k).permutation(len(share))]
        for k, share in enumerate(shares)
    ]


def _check_same(path: Path, floors: list[str], every: int) -> None:
    """Note which floors are asked for; resets of others are refused."""
    asked = {"version": lidarium.__version__, "floors": len(floors), "every": every}
    if path.exists() and json.loads(path.read_text(encoding="utf-8")) != asked:
        raise ValueError(
            f"{path.parent} holds resets of other floors or of another version; choose another folder with "
            "--runs"
        )
    write_json(path, asked)


def _settings() -> ExplorationSettings:
    return make_settings(robots=ROBOTS, lidar=LIDAR)


@contextmanager
def _environment(store: Path) -> Iterator[None]:
    """Give processes that are started meanwhile a store, and one thread each."""
    threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"), "1")
    wanted = {FOLDER_VARIABLE: str(store.absolute()), SIZE_VARIABLE: str(STORE_MIB), **threads}
    before = {name: os.environ.get(name) for name in wanted}
    os.environ |= wanted
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def page(folder: Path, command: str) -> str:
    """Return the results as markdown."""
    rows = rows_of(folder / LOG_FILE)
    store_mib = Store(folder / STORE_FOLDER, STORE_MIB * 2**20).size() / 2**20
    floors = len({row["floor"] for row in rows if row["phase"] == "warm"})
    sizes = [_number(row, "tables_bytes") / 2**20 for row in rows if row["phase"] == "warm"]
    lines = [
        "# Floors from cache and store",
        "",
        f"`{command}` on {date.today().isoformat()}, "
        f"lidarium {lidarium.__version__}, Python {platform.python_version()}, {os.cpu_count()} cores: "
        "floors of `set:train`, world of "
        f"0.025 m, {ROBOTS} robots with `{LIDAR}`, maps of 0.05 m.",
        "",
        f"The store holds {floors:,} floors in {store_mib:.1f} MiB, "
        f"{1024.0 * store_mib / max(floors, 1):.1f} KiB each. In memory the "
        f"tables of a floor take {mean(sizes):.2f} MiB in the mean, {max(sizes):.2f} MiB at most.",
        "",
        *_times(rows),
        "",
        "Memory of each process [MiB]: after the warm resets, where the cache is as full as it may be; and "
        "with the tables of as many "
        "floors as there are episodes. PSS counts what processes share by halves, thirds and so on.",
        "",
        *_memory(rows),
    ]
    return "\n".join(lines) + "\n"


def _times(rows: Rows) -> list[str]:
    """Return the table of times."""
    lines = [
        "| reset | floors | floor and tables: mean ms | median | most | rest of the reset: mean ms |",
        "|---|---|---|---|---|---|",
    ]
    for phase, title in (("cold", "cold: made and stored"), ("warm", "warm: from the store")):
        times = [_number(row, "tables_s") * 1e3 for row in rows if row["phase"] == phase]
        rest = [_number(row, "rest_s") * 1e3 for row in rows if row["phase"] == phase]
        lines.append(
            f"| {title} | {len(times):,} | {mean(times):.1f} | {median(times):.1f} | {max(times):.1f} | "
            f"{mean(rest):.1f} |"
        )
    return lines


def _memory(rows: Rows) -> list[str]:
    """Return the table of memory."""
    lines = ["| process | tables held | RSS | PSS | private | shared |", "|---|---|---|---|---|---|"]
    for row in rows:
        if row["phase"] == "warm memory" or str(row["phase"]).startswith("held"):
            cells = [
                f"{_number(row, name):.0f}" if name in row else "-"
                for name in ("tables_mib", "rss_mib", "pss_mib", "private_mib", "shared_mib")
            ]
            title = f"{row['episodes']} floors held" if "episodes" in row else "after the warm resets"
            lines.append(f"| {row['process']}: {title} | {' | '.join(cells)} |")
    return lines


def _number(row: Mapping[str, object], name: str) -> float:
    return float(str(row[name]))


STUDY = Study(page, work=work)
