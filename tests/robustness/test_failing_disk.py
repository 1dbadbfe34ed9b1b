"""Whichever write, fsync, rename or mkdir fails: no command says that all is well while results are missing,
and the same command, called again, completes them.

``LIDARIUM_ROBUSTNESS=all`` lets each operation fail of all commands; the short form takes some, and trains
nothing.
"""

import errno
import json
import os
import random
import shutil
import subprocess
import sys

import numpy as np
import pytest
from drawn_maps import RESOLUTION, apartment, kept
from robustness.failing_disk import OPERATIONS, failing_disk

from lidarium.evaluation.suites.episodes_file import read_episodes
from lidarium.mapping.files.map_files import write_ros_map
from lidarium.scripts.main import main

TRIES = os.environ.get("LIDARIUM_ROBUSTNESS", "")
"""How many operations of each command are tried, or ``all``."""

SHORT = {"evaluate": 20, "slam": 8, "merge": 2, "run": 2, "report": 2}
"""How many where nothing is said; those that draw pictures take longer."""

COMMANDS = [*SHORT, *(["train"] if TRIES else [])]
TRAINING = """
seed = 1
settings = { resolution = 0.1, horizon_s = 600.0, stop_coverage = 0.8 }
rounds = [{ floors = 2, kinds = { apartment = 1.0 }, robots = [1] }]
fit = { epochs = 1, batch = 8 }
ppo = { decisions = 8, checkpoint = 4, environments = 1, steps = 4, batch = 4, epochs = 1 }
validation = { floors = ["apartment:7"], robots = [1] }
"""

ERRORS = (errno.ENOSPC, errno.EIO)


def rooms():
    """Cells of 0.1 m: two rooms of 2 x 2 m, joined by a door of 0.8 m."""
    levels = np.zeros((22, 43), np.uint8)
    levels[1:21, 1:21] = levels[1:21, 22:42] = 255
    levels[8:16, 21] = 255
    return levels


def write_log(path):
    """A robot drives a metre along a room of 4 x 4 m and scans it."""
    lines = []
    angles = np.radians(np.arange(180.0) - 90.0)
    for step in range(12):
        x = 0.1 * step
        with np.errstate(divide="ignore"):
            ahead = np.where(np.cos(angles) > 0, (3.0 - x) / np.cos(angles), np.inf)
            aside = np.where(np.sin(angles) != 0, 2.0 / np.abs(np.sin(angles)), np.inf)
        ranges = " ".join(f"{value:.2f}" for value in np.minimum(ahead, aside))
        place = f"{x:.3f} 0.0 0.0 {x:.3f} 0.0 0.0"
        lines.append(f"FLASER 180 {ranges} {place} {step:.2f} host {step:.2f}")
    path.write_text("\n".join(lines) + "\n")


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    """A floor, two maps of it that overlap, a log, and the episodes of an evaluation."""
    folder = tmp_path_factory.mktemp("inputs")
    write_ros_map(folder, "rooms", rooms(), (0.0, 0.0, 0.0), 0.1)
    write_log(folder / "log.log")
    (folder / "training.toml").write_text(TRAINING)
    parts = {
        "west": kept(apartment(), slice(0, 180), slice(0, 150)),
        "east": kept(apartment(), slice(0, 180), slice(58, 220)),
    }
    for name, levels in parts.items():
        write_ros_map(folder, name, levels, (0.0, 0.0, 0.0), RESOLUTION)
    team = ["--policies", "nearest_frontier", "--robots", "1", "--seeds", "1", "--horizon-s", "2"]
    told = ["evaluate", *team, "--floors", str(folder / "rooms.yaml"), "--workers", "1", "--no-records"]
    assert main([*told, "--out", str(folder / "episodes")]) == 0
    return folder


def arguments_of(command, inputs):
    floor = str(inputs / "rooms.yaml")
    short = ["--floors", floor, "--robots", "1", "--seeds", "2", "--horizon-s", "1", "--workers", "1"]
    more = {
        "evaluate": ["--policies", "random_walk", "--map-resolution", "0.1", *short],
        "run": ["--floor", floor, "--robots", "1", "--horizon-s", "1", "--map-resolution", "0.1", "--record"],
        "merge": [str(inputs / "west.yaml"), str(inputs / "east.yaml")],
        "slam": [str(inputs / "log.log")],
        "report": [str(inputs / "episodes")],
        "train": [str(inputs / "training.toml"), "--workers", "1"],
    }
    return [command, *more[command]]


def found_in(folder):
    """Names and, where they tell nothing of time, contents of the files of a folder."""
    files = {path.relative_to(folder).as_posix(): path for path in folder.rglob("*") if path.is_file()}
    kept = {}
    for name, path in files.items():
        content = path.read_bytes()
        if name.endswith("episodes.jsonl"):
            kept[name] = sorted(json.loads(line)["key"] for line in content.splitlines())
        elif name.startswith("tensorboard/"):  # curves for people, by the time of the clock
            continue
        elif name.endswith((".json", ".jsonl")):
            kept[name] = sorted(json.loads(content)) if name.endswith(".json") else None
        else:
            kept[name] = content
    return kept


def tried(command, count):
    """Numbers of the operations that are let fail."""
    if TRIES == "all":
        return range(1, count + 1)
    wanted = int(TRIES) if TRIES else SHORT[command]
    return sorted(random.Random(command).sample(range(1, count + 1), min(wanted, count)))


@pytest.mark.filterwarnings("ignore:.*cut off", "ignore:Mean of empty slice")
@pytest.mark.parametrize("command", COMMANDS)
def test_no_failing_operation_loses_results_unsaid(command, inputs, tmp_path, capsys):
    arguments = [*arguments_of(command, inputs), "--out"]
    whole = tmp_path / "whole"
    with failing_disk(whole) as disk:
        assert main([*arguments, str(whole)]) == 0
    expected, count = found_in(whole), disk.count
    assert set(disk.operations) == set(OPERATIONS)
    for failing in tried(command, count):
        out = tmp_path / f"out{failing}"
        with failing_disk(out, failing, ERRORS[failing % len(ERRORS)]) as disk:
            code = main([*arguments, str(out)])
        told = capsys.readouterr().err
        place = f"operation {failing} of {count}, {disk.operations[failing - 1]}"
        assert disk.count >= failing, place
        assert "Traceback" not in told, place + told
        assert code != 0 or found_in(out) == expected, place
        assert code == 0 or os.strerror(ERRORS[failing % len(ERRORS)]) in told, place + told
        assert main([*arguments, str(out)]) == 0, place + capsys.readouterr().err
        assert found_in(out) == expected, place
        shutil.rmtree(out)


LIMIT_BYTES = 2048
"""More than a suite and a few lines of episodes, less than a record."""


def limit_files():
    import resource

    resource.setrlimit(resource.RLIMIT_FSIZE, (LIMIT_BYTES, LIMIT_BYTES))


@pytest.mark.skipif(os.name == "nt", reason="no such limits there")
def test_an_evaluation_of_several_processes_ends_at_the_first_record_that_does_not_fit(inputs, tmp_path):
    arguments = [*arguments_of("evaluate", inputs), "--seeds", "40", "--workers", "2"]
    program = "import sys; from lidarium.scripts.main import main; sys.exit(main())"
    told = subprocess.run(
        [sys.executable, "-c", program, *arguments, "--out", str(tmp_path / "out")],
        capture_output=True,
        text=True,
        preexec_fn=limit_files,
        timeout=120,
    )
    assert told.returncode == 2, told.stderr
    assert f"{os.strerror(errno.EFBIG)}; the episodes before are kept" in told.stderr
    assert "Traceback" not in told.stderr
    assert not read_episodes(tmp_path / "out" / "episodes.jsonl")
    assert not list((tmp_path / "out" / "records").glob("*.npz"))
