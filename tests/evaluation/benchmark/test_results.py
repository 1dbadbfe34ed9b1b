"""A benchmark from the command to the table, the page and the card."""

import json

import pytest

from lidarium.evaluation.analysis.episodes import read_episodes
from lidarium.evaluation.benchmark import results
from lidarium.evaluation.benchmark.results import packed, reference_rows, rows_file
from lidarium.evaluation.benchmark.tasks import benchmark
from lidarium.scripts.main import main


def change_hashes(folder, **changes):
    """Let the benchmark have been frozen with other hashes."""
    hashes = json.loads((folder / "tiny.json").read_text())
    for name, change in changes.items():
        hashes[name.replace("_", "-")].update(change)
    (folder / "tiny.json").write_text(json.dumps(hashes))
    benchmark.cache_clear()


def answer(out, *options):
    """Run the command; return its exit code and what it wrote."""
    code = main(["benchmark", "tiny", "--workers", "1", "--out", str(out), *options])
    return code, json.loads((out / "results.json").read_text())


@pytest.fixture
def without_page(monkeypatch):
    """Leave out the report, which takes longer than the episodes."""
    monkeypatch.setattr(results, "write_report", lambda *_: None)


def by_name(written):
    return {(each["task"], each["policy"]): each for each in written["standings"]}


def test_only_the_newcomer_runs_and_stands_beside_the_reference_policies(tiny, tmp_path, capsys):
    out = tmp_path / "mine"
    code, written = answer(out, "--policies", "explore_lite", "--quick", "--tasks", "Homes-1")
    assert code == 0
    standings = by_name(written)
    assert {policy for _, policy in standings} == {"explore_lite", "nearest_frontier", "random_walk"}
    mine = standings["Homes-1", "explore_lite"]
    assert (mine["is_reference"], mine["runs"], mine["asked"]) == (False, 6, 6)
    assert standings["Homes-1", "nearest_frontier"]["ratio"] is None
    assert standings["Homes-1", "random_walk"]["is_reference"]
    assert 0.0 < mine["ratio"]["estimate"] < 10.0
    assert written["overall"]["explore_lite"] == [pytest.approx(mine["ratio"]["estimate"]), 1]
    assert written["remarks"] == []
    assert len(read_episodes(out / "Homes-1").rows) == 6
    table = (out / "table.md").read_text()
    assert f"| {mine['ratio']['estimate']:.3f} [" in table
    assert "| Homes-1 | **`explore_lite`** | 6 |" in table
    assert "easy" in (out / "card.md").read_text()
    assert (out / "report" / "report.html").is_file()
    assert "* explore_lite" in capsys.readouterr().out


@pytest.mark.usefixtures("without_page")
def test_rows_are_the_shipped_ones_to_the_bit_with_any_number_of_workers(tiny, tmp_path):
    rows, out = [], tmp_path / "again"
    for task, workers in (("Homes-1", "2"), ("Seen-1", "1")):
        answer(out / task, "--reference", "--quick", "--tasks", task, "--workers", workers)
        rows += read_episodes(out / task / task).rows
    shipped = [row for kept in reference_rows("tiny").values() for row in kept]
    keys = {row["key"] for row in rows}
    assert len(keys) == 13
    assert packed(rows) == packed(row for row in shipped if row["key"] in keys)


def test_rows_come_back_as_they_were_packed(tiny):
    before = reference_rows("tiny")
    rows = [dict(row) for kept in before.values() for row in kept]
    del rows[2]["auc"], rows[5]["overlap"]  # rows of older versions lack what came later
    (tiny / rows_file("tiny")).write_bytes(packed(reversed(rows)))
    again = [row for kept in reference_rows("tiny").values() for row in kept]
    assert sorted(again, key=lambda row: row["key"]) == sorted(rows, key=lambda row: row["key"])


@pytest.mark.usefixtures("without_page")
def test_a_floor_or_a_setting_that_changed_is_left_out_and_named(tiny, tmp_path):
    change_hashes(tiny, Homes_1={"floors": ["0" * 16] * 7}, Seen_1={"settings": "f" * 16})
    code, written = answer(tmp_path / "mine", "--reference", "--quick")
    assert code == 0
    assert all(each["is_reference"] for each in written["standings"])
    assert any(
        remark.startswith("Homes-1, random_walk: 6 runs left out, for their floor have other hashes, first on home:00")
        for remark in written["remarks"]
    )
    assert any(
        remark.startswith("Seen-1, sparse_frontier: 1 runs left out, for their settings have")
        for remark in written["remarks"]
    )


@pytest.mark.usefixtures("without_page")
def test_a_policy_that_cannot_run_in_one_task_fails_there_alone(tiny, tmp_path, capsys):
    code, written = answer(tmp_path / "mine", "--policies", "sparse_frontier", "nearest_frontier", "--quick")
    assert code != 0
    assert {("Homes-1", "nearest_frontier"), ("Seen-1", "sparse_frontier")} <= by_name(written).keys()
    assert ("Homes-1", "sparse_frontier") not in by_name(written)
    assert any(remark.startswith("Homes-1, sparse_frontier: ") for remark in written["remarks"])


@pytest.mark.usefixtures("without_page")
def test_a_policy_that_does_not_observe_what_a_task_is_about_is_absent_from_it(tiny, tmp_path):
    code, written = answer(tmp_path / "mine", "--policies", "nearest_frontier", "--quick")
    assert code == 0
    assert ("Homes-1", "nearest_frontier") in by_name(written)
    assert ("Seen-1", "nearest_frontier") not in by_name(written)
    assert "Seen-1, nearest_frontier: does not take part, as it does not observe depth" in written["remarks"]


@pytest.mark.usefixtures("without_page")
def test_a_task_in_which_all_episodes_failed_leaves_the_others(tiny, tmp_path):
    folder = tmp_path / "mine" / "Homes-1"
    folder.mkdir(parents=True)
    (folder / "episodes.jsonl").write_text("")
    code, written = answer(tmp_path / "mine", "--quick")
    assert code == 0
    assert {task for task, _ in by_name(written)} == {"Homes-1", "Seen-1"}


@pytest.mark.usefixtures("without_page")
def test_rows_of_another_version_are_said_to_be(tiny, tmp_path):
    rows = [{**row, "version": "0.0.9"} for kept in reference_rows("tiny").values() for row in kept]
    (tiny / rows_file("tiny")).write_bytes(packed(rows))
    _, written = answer(tmp_path / "mine", "--policies", "explore_lite", "--tasks", "Homes-1", "--quick")
    assert any("Rows are of lidarium 0.0.9 and" in remark for remark in written["remarks"])


@pytest.mark.usefixtures("without_page")
def test_fewer_runs_than_the_size_asks_for_are_said(tiny, tmp_path):
    _, written = answer(tmp_path / "part", "--reference", "--tasks", "Homes-1", "--quick", "--shard", "1/3")
    assert "Homes-1, nearest_frontier: 2 of 6 runs here, so its shipped rows are shown." in written["remarks"]
    assert by_name(written)["Homes-1", "random_walk"]["runs"] == 6
    _, written = answer(tmp_path / "mine", "--policies", "srt", "--tasks", "Homes-1", "--quick", "--shard", "1/3")
    assert "Homes-1, srt: 2 of 6 runs." in written["remarks"]
    assert set(written["overall"]) == {"random_walk"}


@pytest.mark.usefixtures("without_page")
def test_a_task_counts_once_by_whatever_names(tiny, tmp_path):
    _, written = answer(tmp_path / "mine", "--tasks", "Homes-1", "lidarium/Homes-1-v1", "--quick")
    assert written["overall"]["random_walk"][1] == 1


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--tasks", "Home-1"], "did you mean 'Homes-1'"),
        (["--shard", "3/2", "--policies", "srt"], "--shard is '3/2'"),
        (["--workers", "-1"], "--workers is -1"),
        (["--policies", "zoo:ppo-9"], "unknown policy 'zoo:ppo-9'"),
        (
            ["--policies", "random_walk", "--policy-set", "random_walk.seed=1"],
            "--policies mine --policy-set mine.policy=random_walk",
        ),
    ],
)
def test_bad_options_are_answered_in_a_line(tiny, tmp_path, capsys, options, message):
    assert main(["benchmark", "tiny", "--out", str(tmp_path / "x"), *options]) == 2
    assert message in capsys.readouterr().err


@pytest.mark.usefixtures("without_page")
def test_without_rows_of_the_baseline_nothing_is_compared_and_that_is_said(tiny, tmp_path, capsys):
    (tiny / rows_file("tiny")).unlink()
    code, written = answer(tmp_path / "mine", "--policies", "explore_lite", "--tasks", "Homes-1", "--quick")
    assert code == 0
    (mine,) = written["standings"]
    assert (mine["policy"], mine["is_baseline"], mine["ratio"]) == ("explore_lite", False, None)
    assert any("no rows of its baseline nearest_frontier" in remark for remark in written["remarks"])
    assert "| baseline |" not in (tmp_path / "mine" / "table.md").read_text()
    assert "  baseline\n" not in capsys.readouterr().out


@pytest.mark.parametrize(
    ("times", "said"),
    [
        ((50.0, 20.0), "2 rows ran again, all as shipped"),
        ((51.0, 20.0), "1 not as shipped; times differ by up to 2.0%: this version, or a library"),
        ((None, 20.0), "times differ by up to 20.0%"),
    ],
)
def test_rows_that_ran_again_are_compared_with_those_shipped(tiny, times, said):
    shipped, again = (
        [{"key": f"Homes-1 | home:0{k} | 1", "t99_s": time, "wall_s": wall} for k, time in enumerate(found)]
        for found, wall in (((50.0, 20.0), 1.0), (times, 2.0))
    )
    (remark,) = results._repeated(benchmark("tiny").task("Homes-1"), again, shipped)
    assert said in remark
