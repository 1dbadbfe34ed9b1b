"""Curves of trainings in Weights & Biases and MLflow, offline."""

import json
import sys
from types import ModuleType, SimpleNamespace

import pytest

from lidarium.training.loggers import RUNS_FILE, flattened, make_logger
from lidarium.training.progress import Progress

SETTINGS = flattened({"seed": 0, "rounds": [{"floors": 5}], "fit": {"epochs": 2}})
STEPS = [Progress("fit", 1, 2, {"loss": 0.5}), Progress("fit", 2, 2, {"loss": 0.25}), Progress("floors", 1, 9)]


class FakeRun:
    """A run of wandb that keeps what it is told."""

    def __init__(self, **given):
        self.given, self.lines, self.axes, self.ended = given, [], {}, None
        self.id = given["id"] or "abc"

    def define_metric(self, name, step_metric):
        self.axes[name] = step_metric

    def log(self, line):
        self.lines.append(line)

    def finish(self, exit_code):
        self.ended = exit_code


@pytest.fixture
def wandb(monkeypatch):
    module, runs = ModuleType("wandb"), []
    module.init = lambda **given: runs.append(FakeRun(**given)) or runs[-1]
    monkeypatch.setitem(sys.modules, "wandb", module)
    return runs


def test_curves_lie_over_how_far_their_part_has_come(wandb, tmp_path):
    logger = make_logger("wandb", tmp_path, SETTINGS)
    for step in STEPS:
        logger.log(step)
    logger.close(is_whole=True)
    (run,) = wandb
    assert run.given["config"] == {"seed": 0, "rounds.0.floors": 5, "fit.epochs": 2}
    assert run.given["dir"] == str(tmp_path)
    assert run.lines == [
        {"fit/done": 1, "fit/loss": 0.5},
        {"fit/done": 2, "fit/loss": 0.25},
        {"floors/done": 1},
    ]
    assert run.axes == {"fit/*": "fit/done", "floors/*": "floors/done"}
    assert run.ended == 0


def test_a_training_that_goes_on_continues_its_run(wandb, tmp_path):
    make_logger("wandb", tmp_path, SETTINGS).close(is_whole=False)
    make_logger("wandb", tmp_path, SETTINGS).close(is_whole=True)
    assert [run.given["id"] for run in wandb] == [None, "abc"]
    assert [run.ended for run in wandb] == [1, 0]


def test_unknown_loggers_and_missing_packages_are_told(wandb, tmp_path, monkeypatch):
    with pytest.raises(ValueError, match="there is no logger 'paper'; want wandb or mlflow"):
        make_logger("paper", tmp_path, {})
    (tmp_path / RUNS_FILE).write_text("[]")
    with pytest.raises(ValueError, match="remove it, and new ones begin"):
        make_logger("wandb", tmp_path, {})
    monkeypatch.setitem(sys.modules, "wandb", None)
    with pytest.raises(ValueError, match="logging to wandb needs a package: pip install"):
        make_logger("wandb", tmp_path, {})


def test_weights_and_biases_offline(tmp_path, monkeypatch):
    pytest.importorskip("wandb", reason="wandb is not installed: extra [loggers]")
    monkeypatch.setenv("WANDB_MODE", "offline")
    monkeypatch.setenv("WANDB_SILENT", "true")
    logger = make_logger("wandb", tmp_path, SETTINGS)
    for step in STEPS:
        logger.log(step)
    logger.close(is_whole=True)
    run = json.loads((tmp_path / RUNS_FILE).read_text())["wandb"]
    assert list((tmp_path / "wandb").glob(f"offline-run-*-{run}/run-{run}.wandb"))


@pytest.mark.filterwarnings("ignore")
def test_mlflow_in_the_folder(tmp_path, monkeypatch):
    tracking = pytest.importorskip("mlflow.tracking", reason="mlflow is not installed: extra [loggers]")
    monkeypatch.delenv("MLFLOW_TRACKING_URI", raising=False)
    for is_whole, steps in ((False, STEPS[:1]), (True, STEPS[1:])):
        logger = make_logger("mlflow", tmp_path, SETTINGS)
        for step in steps:
            logger.log(step)
        logger.close(is_whole)
    run = json.loads((tmp_path / RUNS_FILE).read_text())["mlflow"]
    client = tracking.MlflowClient(f"sqlite:///{tmp_path / 'mlflow.db'}")
    found = client.get_run(run)
    assert found.data.params["fit.epochs"] == "2"
    assert [(each.step, each.value) for each in client.get_metric_history(run, "fit/loss")] == [(1, 0.5), (2, 0.25)]
    assert found.info.status == "FINISHED"


def test_the_command_hands_steps_to_its_loggers(wandb, tmp_path, monkeypatch):
    from lidarium.scripts.commands import train

    told = []
    fake = SimpleNamespace(log=lambda step: told.append(step), close=lambda is_whole: told.append(is_whole))
    steps = (step for step in STEPS)
    monkeypatch.setattr(train, "_loggers", lambda *given: [fake])
    monkeypatch.setattr(train, "_training_of", lambda *given: SimpleNamespace(run=lambda: steps))
    monkeypatch.setattr(train, "_predictor_answer", lambda *given: "done")
    monkeypatch.setattr(train, "_answer", lambda *given: "done")
    path = tmp_path / "a.toml"
    path.write_text("[prediction]\nfloors = 8\n")
    command = train._Train(config=path, out=tmp_path / "out", log=("wandb",))
    assert train.execute(command) == "done"
    assert told == [*STEPS, True]
