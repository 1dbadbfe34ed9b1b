"""Rounds of lessons, after each of which a network is fitted."""

import json
from dataclasses import replace

import numpy as np
import pytest
import torch

from lidarium.agents import make_policy
from lidarium.agents.learned.decision import choose_classic
from lidarium.agents.learned.network import load_weights, predictor_of
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.evaluation.episodes.runner import run_episode
from lidarium.evaluation.suites.starts import drawn_starts
from lidarium.training.settings import FitSettings, TrainingSettings, training_of
from lidarium.training.teaching import rounds
from lidarium.training.teaching.fitting import evaluate, fit
from lidarium.training.teaching.rounds import RoundFolder, run_round
from lidarium.training.teaching.samples import joined, read_samples, samples_of
from lidarium.training.teaching.teacher import TaughtTours
from lidarium.training.torch_network import ExplorerNetwork

TWO = training_of(
    {
        "settings": {"resolution": 0.1, "stop_coverage": 0.9},
        "rounds": [{"floors": 2, "kinds": {"apartment": 1.0}, "robots": [2]}] * 2,
        "fit": {"epochs": 2, "batch": 8, "learning_rate": 1e-3},
    }
)


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    folder = RoundFolder(tmp_path_factory.mktemp("rounds"), 0)
    return folder, list(run_round(TWO, folder, 1))


def test_a_round_leaves_lessons_weights_and_how_the_fit_went(trained):
    folder, steps = trained
    assert {step.part for step in steps} == {"round 0: lessons", "round 0: fit"}
    for part in ("lessons", "fit"):
        done = [(step.done, step.total) for step in steps if step.part.endswith(part)]
        assert done[-1] == (2, 2)
    content = json.loads((folder.path / "fit.json").read_text())
    assert content["floors"] == 2
    assert content["samples"] == sum(int(step.figures.get("samples", 0.0)) for step in steps)
    assert len(content["epochs"]) == 2
    assert load_weights(folder.weights)


def test_a_finished_round_does_nothing(trained):
    assert list(run_round(TWO, trained[0], 1)) == []


def test_the_next_round_has_other_floors_and_all_lessons(trained):
    folder = RoundFolder(trained[0].training, 1)
    before = folder.before("tours")
    assert (before["option.bias"] == load_weights(trained[0].weights)["option.bias"]).all()
    list(run_round(TWO, folder, 1))
    assert sorted(path.name for path in folder.lessons(0).parent.iterdir()) == ["000002.npz", "000003.npz"]
    content = json.loads((folder.path / "fit.json").read_text())
    assert content["floors"] == 4
    assert content["samples"] > json.loads((trained[0].path / "fit.json").read_text())["samples"]


def test_lessons_that_are_there_are_not_taught_again(trained, tmp_path):
    folder = RoundFolder(tmp_path, 0)
    folder.lessons(0).parent.mkdir(parents=True)
    folder.lessons(1).write_bytes(trained[0].lessons(1).read_bytes())
    steps = list(run_round(TWO, folder, 1))
    assert [step.done for step in steps if step.part.endswith("lessons")] == [1, 2]
    for name, array in load_weights(trained[0].weights).items():
        np.testing.assert_array_equal(load_weights(folder.weights)[name], array)


def test_damaged_lessons_are_named(trained, tmp_path):
    folder = RoundFolder(tmp_path, 0)
    folder.lessons(0).parent.mkdir(parents=True)
    for number in (0, 1):
        folder.lessons(number).write_bytes(trained[0].lessons(number).read_bytes()[: 9_999 * number + 10])
    with pytest.raises(ValueError, match=r"000000\.npz.*remove"):
        list(run_round(TWO, folder, 1))


def test_an_error_on_a_floor_names_the_floor(tmp_path, monkeypatch):
    def fail(*arguments):
        raise ValueError("no room for the robots")

    monkeypatch.setattr(rounds, "run_episode", fail)
    with pytest.raises(ValueError, match=r"apartment:\d+ with 2 robots.*no room for the robots"):
        list(run_round(TWO, RoundFolder(tmp_path, 0), 1))


def test_floors_without_a_choice_leave_a_note_in_place_of_lessons(tmp_path, monkeypatch):
    monkeypatch.setattr(rounds, "run_episode", lambda *arguments: None)
    folder = RoundFolder(tmp_path, 0)
    with pytest.raises(ValueError, match="lessons of 0 floors; want 2 at least"):
        list(run_round(TWO, folder, 1))
    assert sorted(path.name for path in folder.lessons(0).parent.iterdir()) == ["000000.none", "000001.none"]


def test_a_team_of_four_explores_with_a_network_trained_on_two(trained):
    team = TrainingSettings(settings={"resolution": 0.1}).team(4)
    env = ExplorationEnv("apartment:7", team)
    run_episode(make_policy("learned", weights=str(trained[0].weights)), env, 0)
    assert env.scorer.coverage >= 0.99


def test_a_network_is_taught_on_predicted_maps(trained, tmp_path):
    folder = RoundFolder(tmp_path, 0)
    list(run_round(replace(TWO, predictor="truth"), folder, 1))
    assert predictor_of(folder.weights) == "truth"
    assert predictor_of(trained[0].weights) == "nothing"
    scores = [read_samples(each.lessons(0)).decisions.scores for each in (trained[0], folder)]
    assert scores[0].shape != scores[1].shape or (scores[0] != scores[1]).any()
    policy = make_policy("learned", weights=str(folder.weights))
    env = ExplorationEnv("apartment:7", TrainingSettings(settings={"resolution": 0.1}).team(2))
    run_episode(policy, env, 0)
    assert env.scorer.coverage >= 0.99


@pytest.mark.parametrize("network", ["shipped", "file"])
def test_a_training_goes_on_from_a_network(network, trained, tmp_path):
    network = network if network == "shipped" else str(trained[0].weights)
    folder = RoundFolder(tmp_path, 0)
    assert folder.before("tours") is None
    begin = folder.before(network)
    fitting = replace(TWO.fit, epochs=1, learning_rate=1e-9, weight_decay=0.0)
    list(run_round(replace(TWO, begin=network, fit=fitting), folder, 1))
    for name, array in load_weights(folder.weights).items():
        np.testing.assert_allclose(array, begin[name], atol=1e-6)


def test_cloning_reaches_the_teacher_on_one_small_floor():
    team = TrainingSettings(settings={"resolution": 0.1, "stop_coverage": 0.95}).team(1)
    parts = []
    for seed in range(3):
        env = ExplorationEnv("apartment:7", team)
        policy = TaughtTours(env, choose_classic, 0.0, seed)
        run_episode(policy, env, seed, {"starts": drawn_starts("apartment:7", team, seed)})
        parts.append(samples_of(policy.lessons))
    lessons = joined(parts)
    settings = FitSettings(epochs=80, batch=16, learning_rate=2e-3, weight_decay=0.0, correction_cost=0.0)
    torch.manual_seed(0)
    network = ExplorerNetwork()
    before = evaluate(network, [lessons], settings)
    with torch.no_grad():
        network.steepness.fill_(0.05)  # else what tours rank last is hardly ever tried
    list(fit(network, [lessons, lessons], settings, 0))
    assert before > 0.5
    assert evaluate(network, [lessons], settings) < 0.1
