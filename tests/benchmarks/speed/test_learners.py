"""What learners feel is measured as it says, at the least effort."""

import os

import pytest

from lidarium.benchmarks.speed.cases import frontier_decision
from lidarium.benchmarks.speed.cases.learners import (
    first_reset,
    frontier_threads,
    learned_training,
    masked_training,
)
from lidarium.benchmarks.speed.harness.timing import Effort

LEAST = Effort(rounds=1, block_s=0.0)


@pytest.fixture(autouse=True)
def small(monkeypatch):
    monkeypatch.setattr(frontier_decision, "EPISODES", 2)
    monkeypatch.setattr(frontier_decision, "FLOORS", "apartment")
    monkeypatch.setattr(frontier_decision, "WARM_DECISIONS", 1)
    monkeypatch.setattr(frontier_threads, "FLOORS", "apartment")


def test_two_threads_are_compared_idle_and_beside_a_busy_core(monkeypatch):
    monkeypatch.setattr(frontier_threads, "can_use", lambda cores: True)
    idle, busy = frontier_threads.measure(LEAST)
    assert (idle.to_reach, busy.to_reach) == (1.7, 0.95)
    assert idle.ratio.median > 0.0
    assert busy.name.endswith("beside a busy core")


def test_where_there_is_one_core_two_threads_are_not_compared(monkeypatch):
    monkeypatch.setattr(frontier_threads, "can_use", lambda cores: False)
    (line,) = frontier_threads.measure(LEAST)
    assert line.ratio is None


def test_a_training_is_measured_by_its_steps(monkeypatch):
    pytest.importorskip("sb3_contrib", reason='sb3-contrib is not installed: extra "rl"')
    for name, value in {
        "FLOORS": "apartment",
        "EPISODES": 2,
        "ROLLOUT": 4,
        "EPOCHS": 1,
        "WARM_ROLLOUTS": 1,
    }.items():
        monkeypatch.setattr(masked_training, name, value)
    limits = []
    measured = masked_training._rates

    def rates(rounds):
        limits.append(os.environ.get(masked_training.SIZE_VARIABLE))
        return measured(rounds)

    monkeypatch.setattr(masked_training, "_rates", rates)
    monkeypatch.setenv(masked_training.SIZE_VARIABLE, "100")
    lines = masked_training.measure(LEAST)
    assert all(line.figure > 0.0 and line.ours.endswith("steps/s") for line in lines)
    assert limits == ["100", str(masked_training.ALL_MIB)]
    assert os.environ[masked_training.SIZE_VARIABLE] == "100"


def test_without_the_extra_a_training_is_not_measured(monkeypatch):
    monkeypatch.setattr(masked_training, "_is_there", lambda: False)
    (line,) = masked_training.measure(LEAST)
    assert line.figure is None
    assert "lidarium[rl]" in line.peer


def test_a_first_reset_begins_with_empty_caches(monkeypatch):
    seen = []

    def start(environment):
        seen.append(environment)
        return type("Start", (), {"seconds": 1.5})

    monkeypatch.setattr(first_reset, "start", start)
    (line,) = first_reset.measure(LEAST)
    assert (line.figure, line.is_upper_bound, line.to_reach) == (1.5, True, 25.0)
    assert seen[0]["NUMBA_CACHE_DIR"] != seen[0]["XDG_CACHE_HOME"]


def test_a_training_by_rewards_is_measured_with_the_simulators_share(monkeypatch):
    pytest.importorskip("sb3_contrib", reason='sb3-contrib is not installed: extra "rl"')
    small = learned_training.TRAINING.replace(str(learned_training.STEPS), "4")
    small = small.replace("256", "8")
    monkeypatch.setattr(learned_training, "TRAINING", small)
    monkeypatch.setattr(learned_training, "STEPS", 4)
    asked = learned_training._decisions
    monkeypatch.setattr(learned_training, "_decisions", lambda rounds, workers: asked(rounds, 1))
    rate, share = learned_training.measure(LEAST)
    assert rate.figure > 0.0
    assert 0.0 < share.figure < 1.0
    assert share.is_upper_bound


def test_without_the_extra_a_training_by_rewards_is_not_measured(monkeypatch):
    monkeypatch.setattr(learned_training.importlib.util, "find_spec", lambda name: None)
    assert ["lidarium[rl]" in line.peer for line in learned_training.measure(LEAST)] == [True, True]
