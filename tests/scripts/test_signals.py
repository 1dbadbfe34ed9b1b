"""SIGTERM is a first Ctrl-C: what is finished is kept, workers end. A second one ends without a traceback."""

import json
import os
import signal
import subprocess
import sys
import time
from functools import wraps
from pathlib import Path

import pytest
from films_read import read_film, share_of

from lidarium.envs.drawing.frame_parts import EXPLORED
from lidarium.evaluation.suites.episodes_file import read_episodes
from lidarium.scripts.main import main

pytestmark = pytest.mark.skipif(os.name == "nt", reason="signals are sent as on Unix")

PROGRAM = "import sys; from lidarium.scripts.main import main; sys.exit(main())"
PATIENCE_S = 120.0
"""Processes are given this long, on a machine that is busy."""

SMALL = ["--floors", "srt_l_room", "--robots", "1", "--horizon-s", "10", "--map-resolution", "0.1"]


def begin(*arguments):
    return subprocess.Popen(
        [sys.executable, "-c", PROGRAM, *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        # A test run in the background may ignore the signal, and hand that on.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )


def begin_evaluation(out):
    """An evaluation of two workers that has a first episode."""
    process = begin("evaluate", "--policies", "random_walk", *SMALL, "--seeds", 5000, "--workers", 2, "--out", out)
    wait_until(lambda: (out / "episodes.jsonl").exists() and (out / "episodes.jsonl").stat().st_size)
    return process


def wait_until(is_so):
    ends = time.monotonic() + PATIENCE_S
    while not is_so():
        assert time.monotonic() < ends
        time.sleep(0.02)


def children(process):
    return [int(number) for number in Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()]


def is_there(number):
    try:
        told = Path(f"/proc/{number}/stat").read_text()
    except OSError:
        return False
    return told.rpartition(")")[2].split()[0] != "Z"


def test_a_run_that_is_terminated_keeps_its_finished_parts(tmp_path):
    out = tmp_path / "out"
    team = ["--policy", "random_walk", "--robots", 1, "--map-resolution", 0.1]
    process = begin("run", "--floor", "apartment", *team, "--gif", "--film-width", 200, "--out", out)
    while "explored" not in process.stderr.readline():
        pass
    process.send_signal(signal.SIGTERM)
    told, errors = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 143, errors
    assert "interrupted" in told
    assert "Traceback" not in errors
    assert json.loads((out / "result.json").read_text())["interrupted"] is True
    names = {path.name for path in out.iterdir()}
    assert names >= {"result.json", "map.yaml", "map.pgm", "run.png", "run.gif"}
    assert not [name for name in names if name.startswith(".")]
    assert share_of(read_film(out / "run.gif").frames[-1], EXPLORED) > 0.0


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="the system does not tell of processes")
def test_an_evaluation_that_is_terminated_keeps_its_episodes_and_ends_its_workers(tmp_path):
    process = begin_evaluation(tmp_path)
    workers = children(process)
    assert len(workers) >= 2
    os.kill(workers[-1], signal.SIGSTOP)  # even one that hears nothing
    process.send_signal(signal.SIGTERM)
    told, errors = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 143, errors
    assert "the same command goes on" in told
    assert "Traceback" not in errors
    assert read_episodes(tmp_path / "episodes.jsonl")
    wait_until(lambda: not any(map(is_there, workers)))


@pytest.mark.parametrize(("second", "pause_s"), [(signal.SIGINT, 0.0), (signal.SIGINT, 0.2), (signal.SIGTERM, 0.05)])
def test_a_second_interrupt_ends_without_a_traceback(tmp_path, second, pause_s):
    process = begin_evaluation(tmp_path)
    process.send_signal(signal.SIGINT)
    for _ in range(3):
        time.sleep(pause_s)
        if process.poll() is None:
            process.send_signal(second)
    _, errors = process.communicate(timeout=PATIENCE_S)
    # Where Python has taken its handlers away already, the signal ends it: 130 and 143 for a shell as well.
    assert process.returncode in (130, 143, -signal.SIGINT, -signal.SIGTERM), errors
    assert "Traceback" not in errors
    assert "Exception ignored" not in errors
    assert read_episodes(tmp_path / "episodes.jsonl")


def test_termination_ends_each_command_as_an_interrupt_does(tmp_path, capsys, monkeypatch):
    from lidarium.scripts.commands import COMMANDS

    def terminated(command):
        signal.raise_signal(signal.SIGTERM)

    for name, execute in COMMANDS.items():
        terminates = wraps(execute)(lambda command: terminated(command))
        monkeypatch.setitem(COMMANDS._items, name, terminates)
    lists = [["show", "robots"], ["floors", "list"], ["floors", "prepare", "apartment"], ["bench"]]
    maps = [["merge", "a.yaml", "b.yaml"], ["slam", "log"], ["report", "x"], ["replay", "x"]]
    before = signal.getsignal(signal.SIGTERM)
    for arguments in [*lists, *maps, ["run"], ["evaluate"], ["reproduce", "floors"]]:
        assert main(arguments) == 143, arguments
        assert "interrupted" in capsys.readouterr().err
    assert signal.getsignal(signal.SIGTERM) == before
