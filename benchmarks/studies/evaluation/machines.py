"""Many episodes, and many machines: a long evaluation, nodes of a Ray cluster, and nodes that are killed."""

import json
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from lidarium.benchmarks.studies.evaluation.programs import PROGRAM, worker_suite
from lidarium.evaluation.suites.campaign import EPISODES_FILE, Campaign
from lidarium.evaluation.suites.episodes_file import TIMINGS, EpisodesFile, read_episodes
from lidarium.evaluation.suites.suite import Suite

SHORT: dict[str, Any] = {"resolution": 0.1, "horizon_s": 1.0, "lidar": {"beams": 45}}
KILLED: dict[str, Any] = {"resolution": 0.1, "horizon_s": 20.0}
FLOORS = ("apartment", "srt_l_room")


def memory_mb(kind: str = "VmRSS", process: str = "self") -> float:
    """Return how much memory a process takes, or has taken at most (``VmHWM``) [MB]."""
    status = Path(f"/proc/{process}/status").read_text()
    return int(status.split(f"{kind}:")[1].split()[0]) / 1000.0


def run_short(folder: Path, first: int, last: int, workers: int) -> dict[str, Any]:
    """Run the short episodes of some seeds into a folder; return what each took.

    They have settings of a name of their own: a report compares within settings.
    """
    suite = Suite(
        policies=("random_walk",),
        floors=("apartment",),
        seeds=tuple(range(first, last)),
        variants={f"from {first}": SHORT},
    )
    began, path = time.perf_counter(), folder / EPISODES_FILE
    for _ in Campaign(suite, folder, workers, records=False).run():
        pass
    return {
        "episodes": last - first,
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
            suite = worker_suite(seeds, ("apartment", "building:17"))
            began = time.perf_counter()
            for _ in Campaign(suite, Path(name), records=False, cluster=cluster.address).run():
                pass
            seconds.append(time.perf_counter() - began)
            count = len(read_episodes(Path(name) / EPISODES_FILE))
    return {"gain": seconds[0] / seconds[1], "episodes": count, "one_s": seconds[0], "two_s": seconds[1]}


def kill_nodes(count: int, seed: int = 0) -> dict[str, Any]:
    """Kill a node of a cluster so many times while an evaluation runs; each time another one joins.

    Raises
    ------
    RuntimeError
        Where an episode was lost, doubled or changed.
    """
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
