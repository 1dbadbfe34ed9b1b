"""``lidarium train``."""

import importlib.util
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import ModuleType, SimpleNamespace

import pytest

from lidarium.agents.learned.network import load_weights
from lidarium.extras import install_command
from lidarium.scripts.commands.train import _file_of, _Shown, _span
from lidarium.scripts.main import main
from lidarium.training.progress import Progress

TINY = """
seed = 1
settings = { resolution = 0.1, horizon_s = 600.0, stop_coverage = 0.8 }
rounds = [{ floors = 2, kinds = { apartment = 1.0 }, robots = [1] }]
fit = { epochs = 1, batch = 8 }
validation = { floors = ["apartment:7"], robots = [1] }
"""
PATIENCE_S = 120.0


@pytest.fixture
def config(tmp_path):
    path = tmp_path / "training.toml"
    path.write_text(TINY)
    return path


def refused(arguments, out, capsys, *words):
    """Assert exit code 2, one clear message, and nothing written."""
    before = sorted(out.rglob("*")) if out.exists() else None
    assert main(["train", *map(str, arguments), "--out", str(out)]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert "Traceback" not in captured.err
    assert "defect" not in captured.err
    for word in words:
        assert word in captured.err
    assert (sorted(out.rglob("*")) if out.exists() else None) == before


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("epohcs = 3", ("training.toml", "'epohcs'", "it has seed")),
        ("[ppo]\nenvironments = 0", ("environments of ppo is 0", "from 1 to 256")),
        ("[ppo]\nenvironmentz = 1", ("ppo has no 'environmentz'", "environments")),
        ("[settings]\nlidar = 'nothing'", ("training.toml", "nothing")),
        ("[validation]\nfloors = ['castle:3']", ("castle:3",)),
        ("[[rounds]\n", ("training.toml", "TOML")),
    ],
)
def test_bad_files_are_refused_before_anything_is_written(change, words, tmp_path, capsys):
    path = tmp_path / "training.toml"
    path.write_text(change)
    refused([path], tmp_path / "out", capsys, *words)


def test_a_missing_file_is_named_and_where_to_find_one(tmp_path, capsys):
    refused([tmp_path / "nowhere.toml"], tmp_path / "out", capsys, "nowhere.toml", "lidarium examples copy")


def test_numbers_that_cannot_be_used_are_refused(config, tmp_path, capsys):
    refused([config, "--workers", "-1"], tmp_path / "out", capsys, "--workers is -1")


def test_the_seed_of_the_line_is_that_of_the_training(config, tmp_path, capsys, monkeypatch):
    def stopped(settings, *_):
        raise ValueError(f"the seed is {settings.seed}")

    monkeypatch.setattr("lidarium.scripts.commands.train._training_of", stopped)
    refused([config, "--seed", "3"], tmp_path / "out", capsys, "the seed is 3")


def test_a_training_that_ships_is_meant_beside_a_folder_of_its_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "ppo-2").mkdir()
    assert _file_of(Path("ppo-2")).name == "ppo-2.toml"


@pytest.mark.parametrize("missing", ["torch", "sb3_contrib", "stable_baselines3", "tensorboard"])
def test_a_missing_extra_is_named(config, tmp_path, capsys, monkeypatch, missing):
    find = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name, *rest: None if name == missing else find(name, *rest))
    refused([config], tmp_path / "out", capsys, f"training needs {missing}", install_command("rl"))


def test_loggers_that_cannot_be_used_are_refused(config, tmp_path, capsys, monkeypatch):
    refused([config, "--log", "paper"], tmp_path / "out", capsys, "no logger 'paper'; want wandb or mlflow")
    monkeypatch.setitem(sys.modules, "wandb", None)
    refused([config, "--log", "wandb"], tmp_path / "out", capsys, "logging to wandb", install_command("loggers"))


@pytest.fixture
def logged(monkeypatch):
    """What Weights & Biases is told; like the real one it writes into the folder at once."""
    module, lines = ModuleType("wandb"), []

    def init(dir, **given):
        (Path(dir) / "wandb").mkdir(exist_ok=True)
        return SimpleNamespace(id="abc", log=lines.append, define_metric=lambda *_, **__: None, finish=lambda **_: None)

    module.init = init
    monkeypatch.setitem(sys.modules, "wandb", module)
    return lines


def test_a_folder_of_other_files_is_left_as_it_is(config, tmp_path, capsys):
    out = tmp_path / "mine"
    out.mkdir()
    (out / "thesis.txt").write_text("mine")
    refused([config], out, capsys, "no training has written them", "another folder")


def test_a_folder_that_is_a_file_is_refused(config, tmp_path, capsys):
    out = tmp_path / "file"
    out.write_text("x")
    refused([config], out, capsys, "not a folder")


def test_a_training_answers_with_its_card(config, tmp_path, capsys, logged):
    out = tmp_path / "out"
    arguments = ["train", str(config), "--workers", "1", "--out", str(out)]
    assert main([*arguments, "--json", "--log", "wandb"]) == 0
    assert logged[-1] == {"best weights/done": 1}
    captured = capsys.readouterr()
    card = json.loads(captured.out)
    assert card["best"] == "round-0"
    assert card["folder"] == str(out)
    assert card["interrupted"] is False
    assert "round 0: lessons: 2 of 2" in captured.err
    assert "best weights: 1 of 1" in captured.err
    assert load_weights(out / "weights.safetensors")
    # The same again, finished as it is, for people.
    assert main(arguments) == 0
    text = capsys.readouterr().out
    assert "time over tour_frontier" in text
    assert f"--policy-set weights={out / 'weights.safetensors'}" in text
    used = ["run", "--policy", "learned", "--policy-set", f"weights={out / 'weights.safetensors'}"]
    world = ["--floor", "apartment:7", "--robots", "1", "--map-resolution", "0.1", "--horizon-s", "5"]
    assert main([*used, *world, "--out", str(tmp_path / "run")]) == 0
    capsys.readouterr()
    other = config.with_name("other.toml")
    other.write_text(TINY.replace("seed = 1", "seed = 2"))
    refused([other], out, capsys, "holds a training with seed = 1, this one has 2")


@pytest.mark.skipif(os.name == "nt", reason="signals are sent as on Unix")
def test_an_interrupted_training_keeps_what_is_finished(config, tmp_path):
    out = tmp_path / "out"
    config.write_text(TINY.replace("floors = 2", "floors = 2000"))
    process = subprocess.Popen(
        [sys.executable, "-c", PROGRAM, "train", str(config), "--workers", "1", "--out", str(out)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    ends = time.monotonic() + PATIENCE_S
    while not list(out.glob("round-0/lessons/*.npz")):
        assert time.monotonic() < ends
        assert process.poll() is None, process.communicate()
        time.sleep(0.02)
    process.send_signal(signal.SIGINT)
    text, errors = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 130, errors
    assert "interrupted" in text
    assert "Traceback" not in errors
    kept = {path.name for path in out.glob("round-0/lessons/*")}
    assert "000000.npz" in kept
    assert not any(name.startswith(".") for name in kept)


PROGRAM = "import sys; from lidarium.scripts.main import main; sys.exit(main())"


def lines_of(capsys, steps, every_s):
    now = [0.0]
    show = _Shown(is_quiet=True, clock=lambda: now[0])
    for step in steps:
        show(step)
        now[0] += every_s
    show.close()
    return capsys.readouterr().err.splitlines()


def test_progress_says_how_long_a_part_still_takes(capsys):
    steps = [Progress("lessons", done, 100, {"floor": done}) for done in (40, 41, 42)]
    assert lines_of(capsys, steps, 60.0) == [
        "lessons: 40 of 100 (floor 40)",
        "lessons: 41 of 100, 59 min left (floor 41)",
        "lessons: 42 of 100, 58 min left (floor 42)",
    ]


def test_of_fast_parts_the_first_and_last_step_are_shown(capsys):
    steps = [Progress("a", done, 9) for done in range(10)] + [Progress("b", 1, 1)]
    assert lines_of(capsys, steps, 0.01) == ["a: 0 of 9", "a: 9 of 9", "b: 1 of 1"]


def test_times_are_shown_in_words():
    assert [_span(seconds) for seconds in (5.0, 89.0, 91.0, 3600.0, 7200.0)] == [
        "5 s",
        "89 s",
        "2 min",
        "60 min",
        "2.0 h",
    ]
