"""Resets over the floors of set:train in processes that share a store.

Several processes take part; the results are in docs/results/floor_cache.md.

    python benchmarks/studies/floor_cache.py --floors 100 --processes 2
    python benchmarks/studies/floor_cache.py --processes 2 --out docs/results/floor_cache.md

Three phases, each in fresh processes: *cold*, each process makes its share of the floors; *warm*, each loads
the floors that another one made; *held*, each loads as many floors as it has episodes and holds them. Every
reset is appended to ``resets.jsonl`` in the folder of ``--runs`` at once; a second call goes on where the
first stopped.
"""

import argparse
import json
import multiprocessing
import os
import platform
import sys
import time
from collections.abc import Callable
from datetime import date
from pathlib import Path
from statistics import mean, median

import numpy as np
from tqdm import tqdm

STORE_MIB = 1024
ROBOTS, LIDAR = 2, "lidar_360_6m"


def memory() -> dict[str, float]:
    """Return how much memory this process takes, whole, private and shared [MiB].

    Empty where the system does not tell.
    """
    try:
        lines = Path("/proc/self/smaps_rollup").read_text().splitlines()[1:]
    except OSError:
        return {}
    told = {name.rstrip(":"): int(size) / 1024.0 for name, size, *_ in map(str.split, lines)}
    private, shared = (
        sum(size for name, size in told.items() if name.startswith(kind)) for kind in ("Private_", "Shared_")
    )
    return {"rss_mib": told["Rss"], "pss_mib": told["Pss"], "private_mib": private, "shared_mib": shared}


def append(path: Path, row: dict[str, object]) -> None:
    """Append a line in one write, so that lines of several processes do not mix."""
    with path.open("ab", buffering=0) as lines:
        lines.write((json.dumps(row) + "\n").encode())


def reset_over(phase: str, process: int, floors: list[str], log: Path) -> None:
    """Reset an environment on each floor.

    The time of floor and tables is taken apart from that of the rest.
    """
    from lidarium.envs.exploration import ExplorationEnv
    from lidarium.envs.floors.catalogue.names import load_floor
    from lidarium.envs.settings.making import make_settings
    from lidarium.envs.simulation.kernels.floor_cache import floor_tables

    settings = make_settings(robots=ROBOTS, lidar=LIDAR)
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
    from lidarium.envs.floors.catalogue.names import load_floor
    from lidarium.envs.settings.making import make_settings
    from lidarium.envs.simulation.kernels.floor_cache import floor_tables

    settings = make_settings(robots=ROBOTS, lidar=LIDAR)
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


def rows_of(log: Path) -> list[dict[str, object]]:
    """Read what has been measured."""
    return [json.loads(line) for line in log.read_text().splitlines()] if log.exists() else []


def run_phase(work: Callable[..., None], phase: str, shares: list[list[str]], log: Path, total: int) -> None:
    """Run a phase in a process for each share, with a progress bar.

    The bar follows the ``total`` lines of the log.
    """
    context = multiprocessing.get_context("spawn")
    processes = [context.Process(target=work, args=(phase, k, share, log)) for k, share in enumerate(shares)]
    for process in processes:
        process.start()
    known = len(rows_of(log))
    with tqdm(total=total, desc=phase, file=sys.stderr) as bar:
        while any(process.is_alive() for process in processes):
            time.sleep(0.5)
            bar.update(min(len(rows_of(log)) - known, total) - bar.n)
    if any(process.exitcode for process in processes):
        raise SystemExit(f"a process of phase {phase} failed")


def measure(arguments: argparse.Namespace, log: Path) -> None:
    """Run what is missing in the log."""
    from lidarium.envs.floors.catalogue.names import set_floors

    floors = list(set_floors("set:train")[: arguments.floors])
    count = arguments.processes
    for phase, shift in (("cold", 0), ("warm", 1)):
        done = {row["floor"] for row in rows_of(log) if row["phase"] == phase}
        shares = [
            [floor for floor in floors[(k + shift) % count :: count] if floor not in done]
            for k in range(count)
        ]
        if shift:
            shares = [
                [share[place] for place in np.random.default_rng(k).permutation(len(share))]
                for k, share in enumerate(shares)
            ]
        if any(shares):
            run_phase(reset_over, phase, shares, log, sum(map(len, shares)))
    for episodes in arguments.episodes:
        generator = np.random.default_rng(episodes)
        chosen = [
            generator.choice(len(floors), min(episodes, len(floors)), replace=False) for _ in range(count)
        ]
        shares = [[floors[place] for place in places] for places in chosen]
        if not any(row["phase"] == f"held {episodes}" for row in rows_of(log)):
            run_phase(hold, f"held {episodes}", shares, log, count)


def report(arguments: argparse.Namespace, rows: list[dict[str, object]], store_mib: float) -> str:
    """Return the tables of what was measured."""
    import lidarium

    floors = len({row["floor"] for row in rows if row["phase"] == "warm"})
    sizes = [float(str(row["tables_bytes"])) / 2**20 for row in rows if row["phase"] == "warm"]
    lines = [
        "# Floors from cache and store",
        "",
        f"`python benchmarks/studies/floor_cache.py --floors {arguments.floors} --processes "
        f"{arguments.processes}` on {date.today().isoformat()}, "
        f"lidarium {lidarium.__version__}, Python {platform.python_version()}, {os.cpu_count()} cores: "
        "floors of `set:train`, world of "
        f"0.025 m, {ROBOTS} robots with `{LIDAR}`, maps of 0.05 m.",
        "",
        f"The store holds {floors:,} floors in {store_mib:.1f} MiB, "
        f"{1024.0 * store_mib / max(floors, 1):.1f} KiB each. In memory the "
        f"tables of a floor take {mean(sizes):.2f} MiB in the mean, {max(sizes):.2f} MiB at most.",
        "",
        "| reset | floors | floor and tables: mean ms | median | most | rest of the reset: mean ms |",
        "|---|---|---|---|---|---|",
    ]
    for phase, title in (("cold", "cold: made and stored"), ("warm", "warm: from the store")):
        times = [float(str(row["tables_s"])) * 1e3 for row in rows if row["phase"] == phase]
        rest = [float(str(row["rest_s"])) * 1e3 for row in rows if row["phase"] == phase]
        lines.append(
            f"| {title} | {len(times):,} | {mean(times):.1f} | {median(times):.1f} | {max(times):.1f} | "
            f"{mean(rest):.1f} |"
        )
    lines += [
        "",
        "Memory of each process [MiB]: after the warm resets, where the cache is as full as it may be; and "
        "with the tables of as many "
        "floors as there are episodes. PSS counts what processes share by halves, thirds and so on.",
        "",
        "| process | tables held | RSS | PSS | private | shared |",
        "|---|---|---|---|---|---|",
    ]
    for row in rows:
        if row["phase"] == "warm memory" or str(row["phase"]).startswith("held"):
            told = [
                f"{float(str(row[name])):.0f}" if name in row else "-"
                for name in ("rss_mib", "pss_mib", "private_mib", "shared_mib")
            ]
            held = f"{float(str(row['tables_mib'])):.0f}" if "tables_mib" in row else "-"
            title = f"{row['episodes']} floors held" if "episodes" in row else "after the warm resets"
            lines.append(f"| {row['process']}: {title} | {held} | {' | '.join(told)} |")
    return "\n".join(lines) + "\n"


def main() -> None:
    """Measure and tell."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--floors", type=int, default=10_000, help="the first so many floors of the set")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument(
        "--episodes", type=int, nargs="+", default=[64, 1024], help="floors that each process holds at once"
    )
    parser.add_argument(
        "--runs", type=Path, default=Path("runs/floor_cache"), help="where the store and the measurements lie"
    )
    parser.add_argument("--out", type=Path, help="write the report there, too")
    arguments = parser.parse_args()
    arguments.runs.mkdir(parents=True, exist_ok=True)
    os.environ |= {
        "LIDARIUM_FLOOR_STORE": str(arguments.runs / "store"),
        "LIDARIUM_FLOOR_STORE_MIB": str(STORE_MIB),
    }
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"):
        os.environ[variable] = "1"
    from lidarium.envs.floors.catalogue.store import floor_store

    log = arguments.runs / "resets.jsonl"
    measure(arguments, log)
    text = report(arguments, rows_of(log), floor_store().size() / 2**20)
    print(text)
    if arguments.out:
        arguments.out.parent.mkdir(parents=True, exist_ok=True)
        arguments.out.write_text(text)


if __name__ == "__main__":
    main()
