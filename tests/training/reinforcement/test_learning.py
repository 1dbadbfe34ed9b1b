"""Learning from rewards, from checkpoint to checkpoint."""

import multiprocessing
import os
import signal

import numpy as np
import pytest
from stable_baselines3.common.vec_env import SubprocVecEnv
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from lidarium.agents.learned.network import load_weights, save_weights
from lidarium.training.reinforcement import learning
from lidarium.training.reinforcement.checkpoints import latest_checkpoint, weights_of
from lidarium.training.reinforcement.learning import learn
from lidarium.training.reinforcement.masked_ppo import ExplorerPolicy
from lidarium.training.settings import training_of
from lidarium.training.torch_network import ExplorerNetwork

SMALL = {"checkpoint": 8, "environments": 2, "steps": 4, "batch": 8, "epochs": 1, "learning_rate": 1e-3}


def training(decisions, **ppo):
    return training_of(
        {
            "settings": {"resolution": 0.1, "stop_coverage": 0.8},
            "rounds": [{"kinds": {"apartment": 1.0}, "robots": [1]}],
            "ppo": {**SMALL, "decisions": decisions, **ppo},
        }
    )


def weights_in(folder):
    return load_weights(weights_of(folder, latest_checkpoint(folder)))


def learned(folder, decisions, begin=None, **ppo):
    return list(learn(training(decisions, **ppo), folder, begin, 1, folder / "log"))


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    folder = tmp_path_factory.mktemp("whole")
    return folder, learned(folder, 20)


def test_decisions_are_made_up_to_whole_checkpoints(whole):
    folder, steps = whole
    assert [step.done for step in steps] == [0, 8, 16, 24]
    assert {step.total for step in steps} == {24}
    curve = latest_checkpoint(folder).curve
    assert [number for number, _ in curve] == [8, 16, 24]
    assert list((folder / "log").glob("events.*"))


def test_a_training_that_goes_on_has_the_same_curve_and_weights(whole, tmp_path):
    for decisions in (8, 16, 24):
        learned(tmp_path, decisions)
    assert latest_checkpoint(tmp_path) == latest_checkpoint(whole[0])
    for name, array in weights_in(whole[0]).items():
        np.testing.assert_array_equal(weights_in(tmp_path)[name], array)
    curves = [steps_of(folder / "log", "time/fps") for folder in (whole[0], tmp_path)]
    assert curves[0] == curves[1]
    assert curves[0] == [8, 16, 24]


def steps_of(folder, name):
    """Return at which decisions a figure is in TensorBoard's files."""
    events = EventAccumulator(str(folder))
    events.Reload()
    return sorted(each.step for each in events.Scalars(name))


def test_what_is_finished_is_not_learned_again(whole):
    before = {path: path.stat().st_mtime_ns for path in whole[0].glob("decisions-*")}
    assert learned(whole[0], 24) == []
    assert {path: path.stat().st_mtime_ns for path in whole[0].glob("decisions-*")} == before


def test_it_begins_with_the_weights_that_are_given(tmp_path):
    begin = tmp_path / "begin.safetensors"
    given = ExplorerNetwork().weights()
    given["steepness"] = np.array([0.5], np.float32)
    save_weights(begin, given)
    learned(tmp_path, 8, begin, learning_rate=1e-9)
    for name, array in weights_in(tmp_path).items():
        np.testing.assert_allclose(array, given[name], atol=1e-6, err_msg=name)


def environments_of(folder):
    """Return learning in processes of its own that has begun, and these."""
    steps = learn(training(24, environments=1), folder, None, 2, folder / "log")
    next(steps)
    assert next(steps).done == 8
    (process,) = multiprocessing.active_children()
    return steps, process


def test_processes_change_nothing_and_end_where_learning_is_broken_off(tmp_path):
    learned(tmp_path / "one", 8, environments=1)
    steps, process = environments_of(tmp_path / "other")
    assert latest_checkpoint(tmp_path / "other") == latest_checkpoint(tmp_path / "one")
    for name, array in weights_in(tmp_path / "one").items():
        np.testing.assert_array_equal(weights_in(tmp_path / "other")[name], array)
    os.kill(process.pid, signal.SIGKILL)
    with pytest.raises(ValueError, match=r"process of an environment has ended.*last checkpoint is kept"):
        next(steps)
    assert not multiprocessing.active_children()
    assert latest_checkpoint(tmp_path / "other").decisions == 8


def test_an_interrupt_while_processes_work_ends_them(tmp_path, monkeypatch):
    """They may have answered or not: they are not asked."""
    steps, process = environments_of(tmp_path)

    def interrupted(environment):
        raise KeyboardInterrupt

    monkeypatch.setattr(SubprocVecEnv, "step_wait", interrupted)
    with pytest.raises(KeyboardInterrupt):
        next(steps)
    assert not process.is_alive()


def test_a_damaged_checkpoint_is_named_and_the_one_before_goes_on(whole, tmp_path):
    learned(tmp_path, 16)
    newest = tmp_path / "decisions-000000016.learner.safetensors"
    newest.write_bytes(newest.read_bytes()[:100])
    with pytest.raises(ValueError, match=r"remove .*decisions-000000016\.\* to go on"):
        learned(tmp_path, 24)
    for path in tmp_path.glob("decisions-000000016.*"):
        path.unlink()
    learned(tmp_path, 24)
    for name, array in weights_in(whole[0]).items():
        np.testing.assert_array_equal(weights_in(tmp_path)[name], array)


def test_the_reward_of_a_checkpoint_is_the_mean_of_all_its_episodes():
    settings = training(600, checkpoint=600, steps=300)
    environment = learning.environments_of(settings, 1)
    model = learning.model_of(ExplorerPolicy, settings.ppo, environment, 0)
    assert model._stats_window_size == 600
    environment.close()
