"""Exploration of real and generated floors with 1, 2 and 3 robots.

It covers every real floor, dungeon and 200 generated floors, and writes docs/results/floors.md.

    python benchmarks/studies/floors.py --data ../shared/data --out runs/floors --workers 2
    python benchmarks/studies/floors.py --out runs/floors --report docs/results/floors.md

Each finished run is appended to ``episodes.jsonl`` at once; a second call goes on where the first stopped.
"""

import argparse
import json
import os
import platform
import sys
import time
from collections import defaultdict
from concurrent.futures import ProcessPoolExecutor, as_completed
from datetime import date
from pathlib import Path
from statistics import median

from tqdm import tqdm

KINDS = {
    "kth": "KTH campus floors (XML, conn >= 0.8)",
    "lifull": "LIFULL apartments (vectors)",
    "slam": "real SLAM maps (ROS yaml)",
    "dungeon": "dungeon maps (PNG)",
    "generated": "generated floors (building:SEED)",
}
GENERATED = range(4_000_000, 4_000_200)


def floors(data: Path) -> list[tuple[str, str]]:
    """Return (kind, floor) of everything that is explored."""
    plans = data / "floorplans"
    connected = {
        name
        for name, entry in json.loads((plans / "kth" / "meta.json").read_text()).items()
        if entry["conn"] >= 0.8
    }
    kth = [
        path
        for path in sorted((plans / "kth" / "xml").glob("*.xml.gz"))
        if path.name.removesuffix(".xml.gz") in connected
    ]
    found = [("kth", path) for path in kth]
    found += [("lifull", path) for path in sorted((plans / "lifull" / "txt").glob("*.txt"))]
    found += [("slam", path) for path in sorted((data / "slam_maps").glob("*.yaml"))]
    found += [("dungeon", path) for path in sorted((plans / "synthetic_dungeon").glob("*.png"))]
    return [(kind, str(path)) for kind, path in found] + [
        ("generated", f"building:{seed}") for seed in GENERATED
    ]


def name_of(floor: str) -> str:
    """Return the floor's name without its folder."""
    return Path(floor).name.split(".")[0] if "/" in floor else floor


def explore(kind: str, floor: str, robots: int, policy: str) -> dict[str, object]:
    """Run one episode without a horizon; what the run says, or why it could not start."""
    import lidarium
    from lidarium.envs.exploration import ExplorationEnv
    from lidarium.envs.settings.making import make_settings
    from lidarium.evaluation.episodes.runner import run_episode

    row: dict[str, object] = {"kind": kind, "floor": name_of(floor), "robots": robots, "policy": policy}
    began = time.perf_counter()
    try:
        env = ExplorationEnv(floor, make_settings(robots=robots, resolution=0.025, horizon_s=None))
        episode = run_episode(lidarium.policy(policy), env, seed=0)
    except ValueError as error:
        return {**row, "error": str(error)}
    scorer, world = env.scorer, env.world
    return {
        **row,
        "area_m2": round(float(env.score.counted[0]) * 0.025**2, 1),
        "coverage": round(scorer.coverage, 5),
        "time_s": round(scorer.time, 1),
        "path_m": round(float(world.travelled.sum()), 1),
        "collisions": int(world.collisions.sum()),
        "ended": sorted(set(scorer.ended_because.values())),
        "given_up": len(episode.given_up),
        "wall_s": round(time.perf_counter() - began, 2),
    }


def key_of(row: dict[str, object]) -> tuple[object, ...]:
    """Return what tells runs apart."""
    return row["kind"], row["floor"], row["robots"], row["policy"]


def run_all(arguments: argparse.Namespace) -> None:
    """Run what is missing in ``episodes.jsonl``."""
    path = arguments.out / "episodes.jsonl"
    path.parent.mkdir(parents=True, exist_ok=True)
    done = {key_of(json.loads(line)) for line in path.read_text().splitlines()} if path.exists() else set()
    jobs = [
        (kind, floor, robots, arguments.policy)
        for kind, floor in floors(arguments.data)
        for robots in arguments.robots
        if (not arguments.kinds or kind in arguments.kinds)
        and (kind, name_of(floor), robots, arguments.policy) not in done
    ][:: arguments.every]
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"):
        os.environ[variable] = "1"
    with (
        ProcessPoolExecutor(arguments.workers) as pool,
        path.open("a") as lines,
        tqdm(total=len(jobs), file=sys.stderr) as bar,
    ):
        for job in as_completed([pool.submit(explore, *job) for job in jobs]):
            row = job.result()
            lines.write(json.dumps(row) + "\n")
            lines.flush()
            bar.update()
            if row.get("error") or float(str(row["coverage"])) < 0.99 or row["collisions"]:
                bar.write(json.dumps(row))


def report(arguments: argparse.Namespace) -> None:
    """Write the table of all runs."""
    import lidarium

    rows = [json.loads(line) for line in (arguments.out / "episodes.jsonl").read_text().splitlines()]
    rows = [row for row in rows if row["policy"] == arguments.policy]
    runs = [row for row in rows if "error" not in row]
    refused = [row for row in rows if "error" in row]
    lines = [
        "# Every floor, explored",
        "",
        f"`python benchmarks/studies/floors.py --workers {arguments.workers}` on {date.today().isoformat()}, "
        f"lidarium {lidarium.__version__}, "
        f"Python {platform.python_version()}: policy `{arguments.policy}`, Kobuki (radius 0.18 m), URG-04LX "
        "(727 beams, 240 degrees, "
        "5.6 m), true poses, no noise, world and maps at 0.025 m, no horizon, seed 0. A run "
        "ends as `covered` when 0.99 of `C_free` is sensed.",
        "",
        "| floors | robots | runs | reached 0.99 | least coverage | collisions | area, median m2 | time, "
        "median s | path, median m "
        "| wall, median s |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for kind, title in KINDS.items():
        for robots in sorted({row["robots"] for row in runs}):
            chosen = [row for row in runs if row["kind"] == kind and row["robots"] == robots]
            if chosen:
                lines.append(
                    f"| {title} | {robots} | {len(chosen)} | "
                    f"{sum(row['coverage'] >= 0.99 for row in chosen)} "
                    f"| {min(row['coverage'] for row in chosen):.4f} | "
                    f"{sum(row['collisions'] for row in chosen)} "
                    f"| {median(row['area_m2'] for row in chosen):.0f} | "
                    f"{median(row['time_s'] for row in chosen):.0f} "
                    f"| {median(row['path_m'] for row in chosen):.0f} | "
                    f"{median(row['wall_s'] for row in chosen):.1f} |"
                )
    missed = [row for row in runs if row["coverage"] < 0.99 or row["collisions"]]
    lines += ["", f"## Misses\n\n{len(missed)} of {len(runs)} runs below 0.99 or with a collision.", ""]
    lines += [
        f"- {row['floor']}, {row['robots']} robots: coverage {row['coverage']:.4f}, collisions "
        f"{row['collisions']}, ended {row['ended']}"
        for row in missed
    ]
    lines += ["", "## Floors that the robots do not fit in", ""]
    lines += [f"- {row['floor']}, {row['robots']} robots: {row['error']}" for row in refused] or ["None."]
    by_floor: dict[tuple[str, str], dict[int, dict[str, object]]] = defaultdict(dict)
    for row in runs:
        by_floor[row["kind"], row["floor"]][row["robots"]] = row
    lines += [
        "",
        "## All runs",
        "",
        "Coverage / time in s / path of the team in m.",
        "",
        "| floor | m2 | 1 robot | 2 robots | 3 robots |",
        "|---|---|---|---|---|",
    ]
    for (_, floor), cells in sorted(
        by_floor.items(), key=lambda item: (list(KINDS).index(item[0][0]), item[0][1])
    ):
        area = next(iter(cells.values()))["area_m2"]
        shown = [
            f"{cells[robots]['coverage']:.3f} / {cells[robots]['time_s']:.0f} / {cells[robots]['path_m']:.0f}"
            if robots in cells
            else "-"
            for robots in (1, 2, 3)
        ]
        lines.append(f"| {floor} | {area} | {' | '.join(shown)} |")
    arguments.report.parent.mkdir(parents=True, exist_ok=True)
    arguments.report.write_text("\n".join(lines) + "\n")


def main() -> None:
    """Run, or write the report."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--data",
        type=Path,
        default=Path(__file__).resolve().parents[2] / "shared" / "data",
        help="folder of the real floors",
    )
    parser.add_argument("--out", type=Path, default=Path("runs/floors"), help="where the runs are kept")
    parser.add_argument("--robots", type=int, nargs="+", default=[1, 2, 3])
    parser.add_argument("--policy", default="nearest_frontier")
    parser.add_argument("--kinds", nargs="*", choices=list(KINDS), default=[])
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--every", type=int, default=1, help="only every n-th of the missing runs")
    parser.add_argument(
        "--report", type=Path, help="write the table of the finished runs there, and run nothing"
    )
    arguments = parser.parse_args()
    report(arguments) if arguments.report else run_all(arguments)


if __name__ == "__main__":
    main()
