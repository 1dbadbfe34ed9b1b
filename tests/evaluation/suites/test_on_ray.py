"""Episodes on a Ray cluster of two nodes, one of which is killed."""

import json
import signal
import socket

import pytest

from lidarium.benchmarks.studies.machines import local_cluster
from lidarium.evaluation.suites.campaign import Campaign
from lidarium.evaluation.suites.episodes_file import TIMINGS
from lidarium.evaluation.suites.on_ray import _Recorded, on_ray
from lidarium.evaluation.suites.suite import Suite
from lidarium.evaluation.suites.trial import DEFAULT_VARIANT
from lidarium.scripts.main import main

ray = pytest.importorskip("ray", reason="Ray is not installed")

pytestmark = [
    pytest.mark.filterwarnings("ignore::DeprecationWarning"),
    pytest.mark.filterwarnings("ignore::FutureWarning"),
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
    pytest.mark.xdist_group("ray"),
]


@pytest.fixture(scope="module")
def cluster():
    with local_cluster(2) as made:
        yield made


def suite():
    return Suite(
        policies=("random_walk", "nearest_frontier"),
        floors=("srt_l_room",),
        robots=(1,),
        seeds=tuple(range(4)),
        variants={DEFAULT_VARIANT: {"resolution": 0.1, "horizon_s": 20.0}},
    )


def lines_in(folder):
    rows = [json.loads(line) for line in (folder / "episodes.jsonl").read_text().splitlines()]
    kept = [{name: value for name, value in row.items() if name not in TIMINGS} for row in rows]
    return sorted(kept, key=lambda row: row["key"])


def test_rows_are_those_of_one_machine_though_a_node_is_killed(cluster, tmp_path):
    list(Campaign(suite(), tmp_path / "here", 1).run())
    victim = cluster.add_node(num_cpus=1)
    campaign = Campaign(suite(), tmp_path / "there", cluster=cluster.address)
    for number, _ in enumerate(campaign.run()):
        if number == 1:
            cluster.remove_node(victim, allow_graceful=False)
    assert not campaign.failures
    assert lines_in(tmp_path / "there") == lines_in(tmp_path / "here")
    records = sorted(path.name for path in (tmp_path / "there" / "records").iterdir())
    assert records == sorted(path.name for path in (tmp_path / "here" / "records").iterdir())


def test_an_episode_without_a_record_comes_back_alone():
    graph = Suite(
        policies=("nearest_node",),
        floors=("srt_l_room",),
        variants={DEFAULT_VARIANT: {"resolution": 0.1, "horizon_s": 20.0, "level": "graph"}},
    )
    line, record = _Recorded(graph, True)(next(graph.trials()))
    assert line["record"] is None
    assert record is None


def test_what_a_task_raises_is_its_result(cluster):
    before = signal.getsignal(signal.SIGTERM)
    results = dict(on_ray(_reciprocal, [0, 2], cluster.address))
    assert signal.getsignal(signal.SIGTERM) is before
    assert results[2] == 0.5
    assert isinstance(results[0], ZeroDivisionError)


def _reciprocal(number):
    return 1.0 / number


def test_an_address_that_does_not_answer_is_refused(tmp_path, capsys):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]
    for address, message in (
        (f"127.0.0.1:{port}", "no Ray cluster answers"),
        ("nowhere", "want auto or HOST:PORT"),
    ):
        command = ["evaluate", "--ray", address, "--seeds", "1", "--out", str(tmp_path / "out")]
        assert main(command) == 2
        assert message in capsys.readouterr().err
