"""The study ``machines``: 10^5 episodes, two nodes of a Ray cluster beside one, and nodes that are killed."""

import json
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from lidarium.benchmarks.results_page import in_file
from lidarium.benchmarks.studies.shared.study import Progress, Study, Task, do_missing, kept_lines
from lidarium.evaluation.statistics.samples import MOST_VALUES
from lidarium.evaluation.suites.campaign import EPISODES_FILE, Campaign
from lidarium.evaluation.suites.episodes_file import TIMINGS, EpisodesFile, read_episodes
from lidarium.evaluation.suites.suite import Suite
from lidarium.mapping.files.guarded_reading import MAX_FILE_BYTES

SHORT: dict[str, Any] = {"resolution": 0.1, "horizon_s": 1.0, "lidar": {"beams": 45}}
KILLED: dict[str, Any] = {"resolution": 0.1, "horizon_s": 20.0}
PROGRAM = "from lidarium.scripts.main import main; import sys; sys.exit(main())"
FLOORS = ("apartment", "srt_l_room")


def memory_mb(kind: str = "VmRSS", process: str = "self") -> float:
    """Return how much memory a process takes, or has taken at most (``VmHWM``) [MB]."""
    status = Path(f"/proc/{process}/status").read_text()
    return int(status.split(f"{kind}:")[1].split()[0]) / 1000.0


def run_short(folder: Path, first: int, last: int, workers: int) -> dict[str, Any]:
    """Run the missing short episodes of some seeds; return how many ran, with their time and memory.

    They have settings of a name of their own: a report compares within settings.
    """
    suite = Suite(
        policies=("random_walk",),
        floors=("apartment",),
        seeds=tuple(range(first, last)),
        variants={f"from {first}": SHORT},
    )
    began, path = time.perf_counter(), folder / EPISODES_FILE
    ran = sum(1 for _ in Campaign(suite, folder, workers, records=False).run())
    return {
        "episodes": last - first,
        "ran": ran,
        "seconds": time.perf_counter() - began,
        "memory_mb": memory_mb(),
        "file_bytes": path.stat().st_size,
    }


def read_again(folder: Path) -> dict[str, Any]:
    """Return how long it takes to open a folder of episodes again, and to report on it."""
    began = time.perf_counter()
    with EpisodesFile(folder / EPISODES_FILE) as file:
        count = len(file.episodes)
    opened_s = time.perf_counter() - began
    began = time.perf_counter()
    with tempfile.TemporaryDirectory() as out:
        command = [sys.executable, "-c", PROGRAM, "report", str(folder), "--replays", "0", "--out", out]
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
        largest_mb = 0.0
        while process.poll() is None:
            largest_mb = max(largest_mb, _memory_of(process.pid))
            time.sleep(0.1)
        if process.returncode:
            raise RuntimeError(f"lidarium report ended with exit code {process.returncode}")
        page_bytes = (Path(out) / "report.html").stat().st_size
    return {
        "episodes": count,
        "opened_s": opened_s,
        "report_s": time.perf_counter() - began,
        "report_mb": largest_mb,
        "page_bytes": page_bytes,
    }


def _memory_of(process: int) -> float:
    try:
        return memory_mb("VmHWM", str(process))
    except (OSError, IndexError):  # it has just ended
        return 0.0


@contextmanager
def local_cluster(nodes: int) -> Iterator[Any]:
    """Yield a Ray cluster of this machine with nodes of one core each."""
    from ray.cluster_utils import Cluster

    handler = signal.getsignal(signal.SIGTERM)  # nodes put one of their own there
    cluster: Any = Cluster(initialize_head=True, head_node_args={"num_cpus": 1, "include_dashboard": False})
    try:
        for _ in range(nodes - 1):
            cluster.add_node(num_cpus=1)
        yield cluster
    finally:
        cluster.shutdown()
        signal.signal(signal.SIGTERM, handler)


def gain_of_nodes(seeds: int) -> dict[str, Any]:
    """Return how much faster two nodes are than one, and how many episodes are run."""
    seconds, count = [], 0
    for nodes in (1, 2):
        with local_cluster(nodes) as cluster, tempfile.TemporaryDirectory() as name:
            suite = _suite_of_nodes(seeds)
            began = time.perf_counter()
            for _ in Campaign(suite, Path(name), records=False, cluster=cluster.address).run():
                pass
            seconds.append(time.perf_counter() - began)
            count = len(read_episodes(Path(name) / EPISODES_FILE))
    return {"gain": seconds[0] / seconds[1], "episodes": count, "one_s": seconds[0], "two_s": seconds[1]}


def kill_nodes(count: int, seed: int = 0) -> dict[str, Any]:
    """Kill a node of a cluster that many times while an evaluation runs; each time another one joins."""
    generator, killed = np.random.default_rng(seed), 0
    with tempfile.TemporaryDirectory() as name:
        there, here = Path(name, "there"), Path(name, "here")
        suite = Suite(
            policies=("random_walk", "nearest_frontier"),
            floors=FLOORS,
            seeds=tuple(range(60 * count)),
            variants={"default": KILLED},
        )
        with local_cluster(2) as cluster:
            victim = cluster.add_node(num_cpus=1)
            campaign = Campaign(suite, there, records=False, cluster=cluster.address)
            runs, wait = campaign.run(), int(generator.integers(1, 20))
            for _ in runs:
                wait -= 1
                if wait:
                    continue
                cluster.remove_node(victim, allow_graceful=False)
                killed += 1
                if killed == count:
                    break
                victim, wait = cluster.add_node(num_cpus=1), int(generator.integers(1, 20))
            runs.close()
            # What was under way at the last kill has to be done too.
            asked = _asked(suite, there)
            trials = [trial for trial in suite.trials() if trial.key in asked]
            for _ in Campaign(suite, there, records=False, trials=trials, cluster=cluster.address).run():
                pass
        for _ in Campaign(suite, here, records=False, trials=trials).run():
            pass
        if _lasting(there) != _lasting(here):
            raise RuntimeError(f"episodes were lost, doubled or changed by {count} kills")
        return {"killed": killed, "episodes": len(trials)}


def _asked(suite: Suite, folder: Path) -> set[str]:
    """Return the keys of all trials up to the last that was finished."""
    keys = [trial.key for trial in suite.trials()]
    finished = {line["key"] for line in read_episodes(folder / EPISODES_FILE)}
    last = max(place for place, key in enumerate(keys) if key in finished)
    return set(keys[: last + 1])


def _lasting(folder: Path) -> list[str]:
    rows = [json.loads(line) for line in (folder / EPISODES_FILE).read_text().splitlines()]
    kept = [{name: value for name, value in row.items() if name not in TIMINGS} for row in rows]
    return sorted(json.dumps(row, sort_keys=True) for row in kept)


def _suite_of_nodes(seeds: int) -> Suite:
    """Return the suite on which nodes are compared."""
    return Suite(
        policies=("nearest_frontier", "explore_lite"),
        floors=("apartment", "building:17"),
        robots=(3,),
        seeds=tuple(range(seeds)),
        variants={"default": {"resolution": 0.025, "stop_coverage": 0.99, "horizon_s": 900.0}},
    )


EPISODES, PIECE = 100_000, 10_000
NODE_SEEDS, NODE_ROUNDS, LONGER = 20, 3, 2
KILLS = 50
LONG, PIECES_FILE, AGAIN_FILE, NODES_FILE, KILLS_FILE = (
    "long",
    "pieces.jsonl",
    "again.jsonl",
    "nodes.jsonl",
    "kills.jsonl",
)

PIECES_TABLE = """| episodes | a piece, each [ms] | memory of the command [MB] | `episodes.jsonl` [MB] |
|---:|---:|---:|---:|"""

PAGE = """# Many episodes, many machines

## 10^5 episodes

Overhead of short episodes (`random_walk` on the apartment for one simulated second, maps of 10 cm, no
records) with {workers} workers, in pieces of {piece:,} with settings of their own.

{pieces}

With all {episodes:,} there, the command opens the file in {opened_s:.1f} s when it is called again.
`lidarium report --replays 0` takes {report_s:.0f} s and {report_mb:,.0f} MB, and its page has
{page_mb:.1f} MB.

Limits, the nearest first ([how to split a run](../tutorials/run_many_episodes.md)):

1. A report compares at most {group:,} episodes of one policy, with the same settings and number of robots.
   Its resamples take 20 kB for each, 1.3 GB at that size.
2. A line takes {line_bytes:,.0f} bytes. Files above {most:,.1f} GB are refused, so a folder ends at
   {limit:,.0f} episodes.
3. The report above took {mb_each:.1f} kB an episode, and a browser has to open its page.

## Nodes

Two nodes of one core each over one, on episodes of three robots, with some six seconds to connect and to load
kernels. To reach: 1.8 x.

| episodes | rounds | two nodes over one, median |
|---:|---:|---|
{gains}

## Killed nodes

During an evaluation on a cluster of three nodes, one of them was killed {killed} times (SIGKILL of all its
processes), each time after 1 to 19 more episodes, and another one joined. Of {killed_episodes:,} episodes
none was lost, doubled or changed: all lines are those of one machine.
"""


@dataclass(frozen=True, slots=True)
class Piece(Task):
    """Some seeds of the short episodes."""

    first: int
    last: int


@dataclass(frozen=True, slots=True)
class Part(Task):
    """A part that is measured, and how large it is."""

    name: str
    size: int
    turn: int = 0


def work(folder: Path, _data: Path | None, every: int, workers: int) -> Progress:
    """Run an N-th of the short episodes, compare nodes, and kill an N-th as many."""
    episodes, seeds, kills = (max(whole // every, 1) for whole in (EPISODES, NODE_SEEDS, KILLS))
    pieces = [Piece(first, min(first + PIECE, episodes)) for first in range(0, episodes, PIECE)]
    yield from do_missing(
        folder / PIECES_FILE, "pieces of short episodes", pieces, partial(_run_piece, folder, workers), 1
    )
    again = [Part("again", episodes)]
    yield from do_missing(folder / AGAIN_FILE, "reading again", again, partial(_again, folder), 1)
    # The longer the work, the less the start of the nodes takes of it.
    rounds = [*(Part("nodes", seeds, turn) for turn in range(NODE_ROUNDS)), Part("nodes", LONGER * seeds)]
    yield from do_missing(folder / NODES_FILE, "comparisons of nodes", rounds, _compare, 1)
    yield from do_missing(folder / KILLS_FILE, "killed nodes", [Part("kills", kills)], _kill, 1)


def _run_piece(folder: Path, workers: int, piece: Piece) -> dict[str, Any]:
    return {**run_short(folder / LONG, piece.first, piece.last, workers), "workers": workers}


def _again(folder: Path, _part: Part) -> dict[str, Any]:
    return read_again(folder / LONG)


def _compare(part: Part) -> dict[str, Any]:
    return gain_of_nodes(part.size)


def _kill(part: Part) -> dict[str, Any]:
    return kill_nodes(part.size)


def _row(episodes: int, line: Mapping[str, Any]) -> str:
    # An interrupted piece is timed by the episodes that ran after it.
    each = f"{1e3 * line['seconds'] / line['ran']:.1f}" if line["ran"] else "-"
    return f"| {episodes:,} | {each} | {line['memory_mb']:.0f} | {line['file_bytes'] / 1e6:.0f} |"


def _gain_row(episodes: int, compared: Sequence[Mapping[str, Any]]) -> str:
    gains = [line["gain"] for line in compared if line["episodes"] == episodes]
    median = statistics.median(gains)
    return f"| {episodes} | {len(gains)} | {median:.2f} x ({min(gains):.2f} to {max(gains):.2f}) |"


def page(folder: Path) -> str:
    """Return the results as markdown."""
    pieces, compared = kept_lines(folder / PIECES_FILE), kept_lines(folder / NODES_FILE)
    [again], [killed] = kept_lines(folder / AGAIN_FILE), kept_lines(folder / KILLS_FILE)
    total, rows = 0, []
    for line in pieces:
        total += line["episodes"]
        rows.append(_row(total, line))
    line_bytes = pieces[-1]["file_bytes"] / total
    return PAGE.format(
        workers=pieces[-1]["workers"],
        piece=pieces[0]["episodes"],
        pieces=in_file(f"{PIECES_TABLE}\n" + "\n".join(rows)),
        episodes=again["episodes"],
        opened_s=again["opened_s"],
        report_s=again["report_s"],
        report_mb=again["report_mb"],
        page_mb=again["page_bytes"] / 1e6,
        line_bytes=line_bytes,
        most=MAX_FILE_BYTES / 1e9,
        group=MOST_VALUES,
        limit=round(MAX_FILE_BYTES / line_bytes, -4),
        mb_each=1e3 * again["report_mb"] / again["episodes"],
        gains="\n".join(_gain_row(count, compared) for count in sorted({each["episodes"] for each in compared})),
        killed=killed["killed"],
        killed_episodes=killed["episodes"],
    )


STUDY = Study(page, work=work, quick=20, needs={"ray": ("ray",)})
