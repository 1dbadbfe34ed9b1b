"""`lidarium evaluate` and `lidarium reproduce` from the command line."""

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace

import pytest

from lidarium.evaluation.suites.episodes_file import TIMINGS, read_episodes
from lidarium.scripts.main import main

SHORT = ["--robots", "1", "--seeds", "2", "--horizon-s", "5", "--map-resolution", "0.05", "--workers", "1"]


def evaluate(*arguments):
    return main(["evaluate", *(str(argument) for argument in arguments)])


def test_an_evaluation_writes_a_folder_and_tells_its_medians(tmp_path, capsys):
    assert evaluate("--policies", "random_walk", "nearest_frontier", *SHORT, "--out", tmp_path) == 0
    told = capsys.readouterr().out
    assert "4 of 4 episodes finished" in told
    assert "random_walk" in told
    assert len(read_episodes(tmp_path / "episodes.jsonl")) == len(list((tmp_path / "records").glob("*.npz"))) == 4
    assert evaluate("--policies", "random_walk", *SHORT, "--out", tmp_path, "--json") == 0
    result = json.loads(capsys.readouterr().out)
    assert (result["episodes"], result["finished"], result["failed"]) == (2, 2, [])
    assert [row["policy"] for row in result["summary"]] == ["random_walk"]


def test_shards_together_are_the_whole_evaluation(tmp_path):
    def lines(*folders):
        rows = [row for folder in folders for row in read_episodes(tmp_path / folder / "episodes.jsonl")]
        return sorted(json.dumps({name: value for name, value in row.items() if name not in TIMINGS}) for row in rows)

    assert evaluate("--policies", "random_walk", *SHORT, "--seeds", "3", "--out", tmp_path / "all") == 0
    for shard in (1, 2):
        part = ["--shard", f"{shard}/2", "--out", tmp_path / f"part-{shard}", "--json"]
        assert evaluate("--policies", "random_walk", *SHORT, "--seeds", "3", *part) == 0
    assert lines("part-1", "part-2") == lines("all")
    assert len(lines("part-1")) == 2


def test_a_file_says_what_to_run(tmp_path, capsys):
    path = tmp_path / "suite.toml"
    path.write_text(
        'policies = ["random_walk"]\nfloors = ["apartment"]\n[settings]\nhorizon_s = 3.0\nresolution = 0.05\n'
    )
    assert evaluate(path, "--out", tmp_path / "out", "--workers", "1", "--no-records") == 0
    (line,) = read_episodes(tmp_path / "out" / "episodes.jsonl")
    assert line["time_s"] == 3.0
    assert line["record"] is None


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--policies", "nearest_fronteer"], "did you mean 'nearest_frontier'"),
        (["--floors", "appartment"], "did you mean 'apartment'"),
        (["--seeds", "0"], "--seeds is 0"),
        (["--workers", "-1"], "--workers is -1"),
        (["--shard", "3/2"], "--shard is '3/2'; want K/N with K from 1 to N"),
        (["--shard", "second"], "--shard is 'second'; want K/N"),
        (["--preset", "ariadn"], "did you mean 'ariadne'"),
        (["--preset", "ariadne"], "give --data"),
        (["none.toml"], "no suite none.toml"),
        (["--preset", "ir2", "--robots", "3"], "--robots is (3,), and the preset ir2 sets it; leave it out"),
        (["none.toml", "--seeds", "5"], "--seeds is 5, and the suite sets it"),
        (["none.toml", "--seeds", "3"], "--seeds is 3, and the suite sets it"),
        (["none.toml", "--horizon-s=1800"], "--horizon-s is 1800.0, and the suite sets it"),
        (["none.toml", "--policy-set", "learned.weights=x"], "--policy-set is ('learned.weights=x',), and the suite"),
        (["--preset", "dare", "--bounds"], "--bounds is True, and the preset dare sets it"),
        (["--noise", "loud"], "loud"),
        (["--robots", "1", "2", "--set", "robots=3"], "--set robots=3 sets what --robots does; want --robots alone"),
    ],
)
def test_bad_input_is_named_and_nothing_is_written(arguments, message, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert evaluate(*arguments, "--out", "out") == 2
    assert message in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_other_settings_in_a_folder_are_refused(tmp_path, capsys):
    assert evaluate("--policies", "random_walk", *SHORT, "--out", tmp_path) == 0
    before = (tmp_path / "episodes.jsonl").read_bytes()
    assert evaluate("--policies", "random_walk", *SHORT, "--noise", "datasheet", "--out", tmp_path) == 2
    assert "noise = its default, this suite has noise = datasheet" in capsys.readouterr().err
    assert (tmp_path / "episodes.jsonl").read_bytes() == before


@pytest.mark.skipif(os.name == "nt", reason="signals are sent as on Unix")
def test_an_interrupted_evaluation_keeps_what_is_finished_and_goes_on(tmp_path, capsys):
    arguments = [
        "--policies",
        "random_walk",
        "--robots",
        "1",
        "--seeds",
        "8",
        "--horizon-s",
        "200",
        "--map-resolution",
        "0.1",
        "--out",
        str(tmp_path),
        "--workers",
        "2",
    ]
    code = "from lidarium.scripts.main import main; import sys; sys.exit(main())"
    # A shell that starts the tests in the background lets their children ignore interrupts.
    process = subprocess.Popen(
        [sys.executable, "-c", code, "evaluate", *arguments],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    ended = time.monotonic() + 60.0
    while time.monotonic() < ended and not (
        (tmp_path / "episodes.jsonl").exists() and (tmp_path / "episodes.jsonl").stat().st_size
    ):
        time.sleep(0.02)
    process.send_signal(signal.SIGINT)
    assert process.wait(30) == 130
    kept = read_episodes(tmp_path / "episodes.jsonl")
    assert kept
    assert evaluate(*arguments, "--workers", "1") == 0
    assert "8 of 8 episodes finished" in capsys.readouterr().out
    assert read_episodes(tmp_path / "episodes.jsonl")[: len(kept)] == kept


def test_the_leaderboard_is_made_by_one_command(tmp_path, capsys, monkeypatch):
    from lidarium.benchmarks.studies.leaderboard import study, worlds

    policies = worlds.WORLDS["ideal"].policies
    monkeypatch.setattr(worlds, "SETTINGS", {"resolution": 0.05, "horizon_s": 4.0})
    monkeypatch.setattr(worlds, "WORLDS", {"ideal": replace(worlds.WORLDS["ideal"], teams=(1,))})
    monkeypatch.setattr(study, "BOUNDED", {})
    arguments = [
        "reproduce",
        "leaderboard",
        "--every",
        "100",
        "--runs",
        str(tmp_path / "runs"),
        "--out",
        str(tmp_path / "out"),
        "--workers",
        "1",
    ]
    assert main(arguments) == 0
    page = (tmp_path / "out" / "leaderboard.md").read_text()
    tables = "".join(path.read_text() for path in sorted((tmp_path / "out").glob("*.csv")))
    assert all(policy in page + tables for policy in policies)
    assert "Generated floors of the set `test` (2)" in page
    assert (tmp_path / "out" / "leaderboard.html").stat().st_size > 50_000
    assert main([*arguments, "--every", "0"]) == 2
    assert main([*arguments, "--data", str(tmp_path)]) == 2
    assert "no real floors below" in capsys.readouterr().err
