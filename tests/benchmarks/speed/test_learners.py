"""What learners feel is measured as it says, at the least effort."""

import os
from dataclasses import replace

import pytest

from lidarium.benchmarks.speed.cases import frontier_decision
from lidarium.benchmarks.speed.cases.learners import (
    attention_training,
    batch_memory,
    first_reset,
    frontier_threads,
    learned_training,
    masked_training,
)
from lidarium.benchmarks.speed.harness.timing import Effort
from lidarium.envs.simulation.kernels.floor_cache import SIZE_VARIABLE
from lidarium.extras import install_command

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


def test_memory_is_told_over_episodes(monkeypatch):
    monkeypatch.setattr(batch_memory, "ROWS", 2)
    monkeypatch.setattr(batch_memory, "FEW_EPISODES", 40)
    peak, growth = batch_memory.measure(LEAST)
    assert 50.0 < peak.figure < 10_000.0
    assert 0.5 < growth.judged < 2.0
    assert (growth.to_reach, growth.is_upper_bound) == (1.05, True)


@pytest.fixture
def short(monkeypatch):
    """A short training, and what memory floors may take in each."""
    monkeypatch.setattr(masked_training, "MANY_FLOORS", "apartment")
    monkeypatch.setattr(attention_training, "FLOORS", "apartment")
    monkeypatch.setattr(masked_training, "WARM_DECISIONS", 8)
    monkeypatch.setattr(masked_training, "TIMED_ROLLOUTS", 1)
    monkeypatch.setenv(SIZE_VARIABLE, "100")
    limits, measured = [], masked_training.timed

    def timed(environments):
        limits.append(os.environ.get(SIZE_VARIABLE))
        return measured(environments)

    monkeypatch.setattr(masked_training, "timed", timed)
    return limits


def test_a_training_is_measured_by_its_steps(monkeypatch, short):
    pytest.importorskip("sb3_contrib", reason='sb3-contrib is not installed: extra "rl"')
    few = replace(masked_training.LEARNER, episodes=2, rollout=4, epochs=1, floors="apartment")
    monkeypatch.setattr(masked_training, "LEARNER", few)
    lines = masked_training.measure(LEAST)
    rates, shares = lines[::2], lines[1::2]
    assert all(line.figure > 0.0 and line.ours.endswith("steps/s") for line in rates)
    assert all(0.0 < line.figure < 1.0 and line.name.endswith("the simulator's share") for line in shares)
    everything = str(masked_training.ALL_MIB)
    assert short == ["100", everything, "100", "100", everything]
    assert os.environ[SIZE_VARIABLE] == "100"


def test_attention_is_measured_with_the_simulators_share(monkeypatch, short):
    pytest.importorskip("sb3_contrib", reason='sb3-contrib is not installed: extra "rl"')
    for name, value in {"EPISODES": 2, "ROLLOUT": 4, "BATCH": 8, "EPOCHS": 1}.items():
        monkeypatch.setattr(attention_training, name, value)
    lines = attention_training.measure(LEAST)
    assert [line.is_upper_bound for line in lines] == [False, True] * 3
    assert all(line.figure > 0.0 for line in lines)
    assert all(line.figure < 1.0 for line in lines if line.is_upper_bound)
    assert short == ["100", str(masked_training.ALL_MIB), "100"]


def test_without_the_extra_a_training_is_not_measured(monkeypatch):
    for case in (masked_training, attention_training):
        monkeypatch.setattr(case, "is_there", lambda: False)
        (line,) = case.measure(LEAST)
        assert line.figure is None
        assert install_command("rl") in line.peer


def test_a_first_reset_begins_with_empty_caches(monkeypatch):
    seen = []

    def start(environment):
        seen.append(environment)
        return type("Start", (), {"seconds": 1.5})

    def run(environment):
        seen.append(environment)
        return 7.0

    monkeypatch.setattr(first_reset, "start", start)
    monkeypatch.setattr(first_reset, "run_seconds", run)
    reset, whole = first_reset.measure(LEAST)
    assert (reset.figure, reset.is_upper_bound, reset.to_reach) == (1.5, True, 12.0)
    assert (whole.figure, whole.is_upper_bound, whole.to_reach) == (7.0, True, 30.0)
    assert len({environment[name] for environment in seen for name in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME")}) == 4


def test_the_first_run_is_that_of_the_command_line(monkeypatch):
    asked = []
    monkeypatch.setattr(first_reset.subprocess, "run", lambda command, **options: asked.append((command, options)))
    assert first_reset.run_seconds({"A": "b"}) >= 0.0
    ((command, options),) = asked
    assert command[1:4] == ["-m", "lidarium", "run"]
    assert options["check"]
    assert options["env"] == {"A": "b"}


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
    assert [install_command("rl") in line.peer for line in learned_training.measure(LEAST)] == [True, True]
