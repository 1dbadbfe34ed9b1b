"""Processes that are forked, spawned or served by a fork server."""

import multiprocessing
import os
import subprocess
import sys
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from robustness import forks

from lidarium.mapping.kernels import compilation

TESTS = Path(__file__).resolve().parents[1]


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system has no fork")
def test_pools_forked_after_threads_started_answer():
    command = [sys.executable, "-W", "ignore::DeprecationWarning", "-m", "robustness.forks", "--count", "2"]
    process = subprocess.run(command, cwd=TESTS, capture_output=True, text=True, timeout=300)
    assert process.returncode == 0, process.stdout + process.stderr
    assert "2 pools: 0 hang, 0 see something else" in process.stdout


@pytest.mark.parametrize("method", ["spawn", "forkserver"])
def test_other_pools_see_what_their_parent_sees(method):
    if method not in multiprocessing.get_all_start_methods():
        pytest.skip(f"this system has no {method}")
    expected = forks.steps_of(forks.make_episodes()[0])
    with multiprocessing.get_context(method).Pool(1) as pool:
        seen = pool.apply_async(forks.run_in_child, (0,)).get(timeout=240)
    assert all(np.array_equal(seen[name], expected[name]) for name in expected)


def test_asynchronous_vector_environments_step_after_threads_started():
    forks.steps_of(forks.make_episodes()[0])
    env = gym.vector.AsyncVectorEnv([forks.make_environment] * 2, context="spawn")
    try:
        env.reset(seed=3)
        env.step(env.action_space.sample())
    finally:
        env.close()


def test_threads_are_those_of_the_process_that_started_them(monkeypatch):
    monkeypatch.setattr(compilation, "_process_of_threads", os.getpid() + 1)
    assert compilation.use_threads(2) == 1
    monkeypatch.setattr(compilation, "_process_of_threads", 0)
    assert compilation.use_threads(1) == 1
    assert compilation._process_of_threads == 0
