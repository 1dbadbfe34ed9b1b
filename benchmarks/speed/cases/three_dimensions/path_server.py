"""Requests a second of a path server, with its client on the same core."""

import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from lidarium.benchmarks.speed.cases.three_dimensions.sparse_planning import BODY, CODES, scene
from lidarium.benchmarks.speed.harness.lines import Line, shown
from lidarium.benchmarks.speed.harness.report import run_alone
from lidarium.benchmarks.speed.harness.timing import Contender, Effort, interleaved, rate, repeated
from lidarium.mapping.sparse.graph import build_graph
from lidarium.mapping.sparse.map_files import read_sparse_map, write_sparse_map
from lidarium.mapping.sparse.path_client import PathClient
from lidarium.mapping.sparse.planning import plan
from lidarium.mapping.sparse.sparse_map import SparseMap, free_codes, occupied_codes

CORES = 1
REQUESTS = 500
TO_REACH = 1000.0

NOTES = (
    f"*Path server*: `lidarium serve` with {CODES:,} free codes of the furnished apartment, and a Python client on the "
    f"same core that asks for {REQUESTS} paths in turn. CPU time is that of both. *Plan alone*: without server.",
)

_PROGRAM = "import sys; from lidarium.scripts.main import main; sys.exit(main())"


@contextmanager
def _served(path: Path) -> Iterator[PathClient]:
    """Serve a map by a process of its own; it takes over the core of this one."""
    process = subprocess.Popen(
        [sys.executable, "-c", _PROGRAM, "serve", str(path), "--port", "0"], stderr=subprocess.PIPE, text=True
    )
    assert process.stderr is not None
    try:
        found = None
        while found is None:
            line = process.stderr.readline()
            if not line:
                raise RuntimeError(f"lidarium serve has ended with exit code {process.wait()}")
            found = re.search(r"at port (\d+)", line)
        with PathClient(int(found[1])) as client:
            yield client
    finally:
        process.terminate()  # programs that run in the background ignore Ctrl-C, and so do those that they start
        process.wait()


def measure(effort: Effort) -> list[Line]:
    """Time plans by a server, and without."""
    free, boxes, _ = scene()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "apartment.smap"
        write_sparse_map(path, SparseMap(occupied=occupied_codes(boxes), ground=free_codes(free)))
        found, _ = read_sparse_map(path)
        graph = build_graph(found.free, found.boxes, BODY)
        drawn = np.random.default_rng(1).integers(0, len(graph.nodes), (REQUESTS, 2))
        requests = graph.nodes[drawn, :2]
        with _served(path) as client:
            ask = repeated(lambda: [client.plan(*request) for request in requests], REQUESTS)
            alone = repeated(lambda: [plan(graph, *request) for request in requests], REQUESTS)
            contenders: dict[str, Contender] = {
                "server": _by_cpu(ask, lambda: _cpu_s(client), lambda: client.status()["requests"]),
                "wall": ask,
                "alone": alone,
            }
            seconds = interleaved(contenders, effort)
    rates = {name: rate(seconds[name]) for name in contenders}
    return [
        Line(
            "path server, plans of one client",
            f"{shown(rates['server'])} requests/CPU s, {shown(rates['wall'])} requests/s",
            f"plan alone: {shown(rates['alone'])} requests/s",
            None,
            TO_REACH,
            rates["server"],
            False,
            "requests/CPU s",
        )
    ]


def _cpu_s(client: PathClient) -> float:
    """Return the CPU time of server and client so far [s]."""
    return float(client.status()["cpu_s"]) + time.process_time()


def _by_cpu(contender: Contender, clock: Callable[[], float], count: Callable[[], int]) -> Contender:
    """Make a contender that returns CPU seconds per request."""

    def run(seconds: float) -> float:
        began, before = clock(), count()
        contender(seconds)
        return (clock() - began) / (count() - before)

    return run


if __name__ == "__main__":
    run_alone(measure, "Requests a second of a path server.")
