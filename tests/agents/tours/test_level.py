"""Decisions by tours."""

import subprocess
import sys

import numpy as np
import pytest

import lidarium

OPTIONS = {"resolution": 0.05, "stop_coverage": 0.95, "horizon_s": 600.0}


@pytest.mark.parametrize(
    ("floor", "robots", "more"),
    [
        ("apartment:7", 1, {}),
        ("building:2000004", 3, {}),
        ("apartment:8", 2, {"radio": "range"}),
        ("apartment:8", 2, {"known_starts": False}),
    ],
)
def test_the_first_action_is_that_of_tour_frontier(floor, robots, more):
    options = {**OPTIONS, "robots": robots, **more}
    classic = lidarium.parallel_env(floor, **options)
    lidarium.run_episode(lidarium.policy("tour_frontier"), classic, seed=3)
    env = lidarium.parallel_env(floor, level="tour", **options)
    env.reset(seed=3)
    while env.agents:
        env.step(dict.fromkeys(env.agents, 0))
    assert env.scorer.time == classic.scorer.time > 5.0
    assert env.scorer.coverage == classic.scorer.coverage
    np.testing.assert_array_equal(env.world.poses, classic.world.poses)


def test_stops_are_described_and_driven_to():
    env = lidarium.parallel_env("apartment:8", level="tour", robots=2, **OPTIONS)
    observations, _ = env.reset(seed=0)
    generator, choices = np.random.default_rng(0), 0
    while env.agents and choices < 20:
        actions = {}
        for agent in env.agents:
            tours, mask = observations[agent]["tours"], observations[agent]["action_mask"]
            assert env.observation_space(agent).contains(observations[agent])
            assert mask[0] == mask[-1] == 1
            count = int(mask[:-1].sum())
            assert (mask[:count] == 1).all()
            assert (tours[count:] == 0.0).all()
            # No way is shorter than the straight line but for the side of a coarse cell at both ends.
            assert (tours[:count, 2] >= np.hypot(tours[:count, 0], tours[:count, 1]) - 0.3).all()
            actions[agent] = int(generator.integers(count))
            choices += count > 1
            if count > 1:
                assert (tours[:count, 3] > 0.0).any()
        before = {agent: observations[agent]["tours"][action] for agent, action in actions.items()}
        observations = env.step(actions)[0]
        for agent in env.agents:
            if before[agent][2] > 2.0 and observations[agent]["action_mask"][:-1].sum() == 1:
                assert observations[agent]["tours"][0, 7] == 1.0  # it drives there
    assert choices >= 10


def test_a_batch_gives_the_same_on_any_number_of_threads():
    found = {}
    for threads in (1, 2):
        envs = lidarium.vector_env(3, "set:train", level="tour", robots=2, threads=threads, **OPTIONS)
        observations, _ = envs.reset(seed=5)
        generator = np.random.default_rng(1)
        found[threads] = [observations["tours"].copy()]
        for _ in range(40):
            chances = generator.random(observations["action_mask"].shape) * observations["action_mask"]
            observations = envs.step(chances.argmax(axis=1))[0]
            found[threads].append(observations["tours"].copy())
        envs.close()
    np.testing.assert_array_equal(found[1], found[2])


@pytest.mark.parametrize("action", [-1, 31, 1.5, "left"])
def test_a_number_that_is_no_stop_is_refused(action):
    env = lidarium.parallel_env("apartment:7", level="tour", robots=1, **OPTIONS)
    env.reset(seed=0)
    with pytest.raises(ValueError, match="want a stop from 0 to 29, or 30 to stay"):
        env.step({"robot_0": action})


@pytest.mark.parametrize("threads", [0, -1, 1.5])
def test_numbers_of_threads_that_are_none_are_refused(threads):
    with pytest.raises((ValueError, TypeError), match="threads"):
        lidarium.vector_env(2, "apartment:7", level="tour", threads=threads)


INTERRUPTED = """
import signal, threading
import numpy as np, lidarium
envs = lidarium.vector_env(6, "set:train", level="tour", robots=2, threads=2, resolution=0.05)
envs.reset(seed=0)
envs.step(np.zeros(12, np.int64))
# A shell that starts the tests in the background lets their children ignore interrupts.
signal.signal(signal.SIGINT, signal.default_int_handler)
threading.Timer(0.3, signal.raise_signal, (signal.SIGINT,)).start()
try:
    while True:
        envs.step(np.zeros(12, np.int64))
except KeyboardInterrupt:
    envs.close()
    print("closed")
"""


def test_an_interrupt_of_plans_on_threads_ends_cleanly():
    done = subprocess.run([sys.executable, "-c", INTERRUPTED], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout.strip(), done.stderr) == (0, "closed", "")
