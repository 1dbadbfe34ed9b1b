"""A benchmark of two tasks that takes seconds."""

import json
import shutil
from contextlib import contextmanager
from dataclasses import asdict

import pytest

from lidarium.evaluation.analysis.episodes import read_episodes
from lidarium.evaluation.benchmark import results, tasks
from lidarium.evaluation.suites.campaign import Campaign

TASKS = """
about = "Two small tasks."
baseline = "nearest_frontier"
policies = ["nearest_frontier", "random_walk"]
horizon_s = 60.0
stop_coverage = 0.99

[tasks.Homes-1]
about = "one robot"
floors = "set:home"
robots = 1
full = 7
easy = 6

[tasks.Seen-1]
about = "one robot with a camera"
floors = ["srt_l_room", "apartment:3000000"]
robots = 1
full = 2
easy = 1
settings = { camera = { columns = 64, rows = 48, pitch = 0.35 }, lidar.range_max = 4.0 }
policies = ["sparse_frontier"]
baseline = "sparse_frontier"
observes = ["depth"]
"""


@contextmanager
def data_in(folder):
    """Let benchmarks be those of a folder."""
    with pytest.MonkeyPatch.context() as patch:
        for module in (tasks, results):
            patch.setattr(module, "DATA", folder)
        tasks.benchmark.cache_clear()
        yield
    tasks.benchmark.cache_clear()


@pytest.fixture(scope="module")
def frozen(tmp_path_factory):
    """Return a folder with the benchmark ``tiny``: its tasks, their hashes, and the rows of its policies."""
    folder = tmp_path_factory.mktemp("data")
    (folder / "tiny.toml").write_text(TASKS)
    (folder / "tiny.md").write_text("# Card\n\n{tasks}\n\n{size} {version} {policies}\n\n{remarks}\n")
    with data_in(folder):
        found = tasks.benchmark("tiny").tasks.values()
        hashes = {task.name: asdict(task.measured_on(task.floors)) for task in found}
        (folder / "tiny.json").write_text(json.dumps(hashes))
        rows = []
        for task in found:
            runs = tmp_path_factory.mktemp("runs")
            for _ in Campaign(task.suite(task.policies, "easy"), runs, records=False).run():
                pass
            rows += read_episodes(runs).rows
        (folder / "tiny.rows.jsonl.xz").write_bytes(results.packed(rows))
    return folder


@pytest.fixture
def tiny(frozen, tmp_path):
    """Return a copy of that folder, in which benchmarks are looked for."""
    folder = tmp_path / "data"
    shutil.copytree(frozen, folder)
    with data_in(folder):
        yield folder
