"""Pools of processes forked after threads have started.

``python -m robustness.forks --count 100``

Run it in the folder ``tests``. A pool that does not answer within a minute counts as hanging.
"""

import argparse
import multiprocessing
import sys

import gymnasium as gym
import numpy as np

import lidarium

EPISODES = 16
HANGS_S = 60.0


def make_episodes():
    """Return a batch of episodes whose kernels run on two threads, with its first observations."""
    env = lidarium.vector_env(EPISODES, "apartment", robots=2, threads=2)
    observations, _ = env.reset(seed=3)
    return env, observations


def make_environment():
    """Return an environment of one robot; its id is there once the package is imported."""
    return gym.make("lidarium/Exploration-v1")


def steps_of(env, steps=5):
    """Return what a row sees after some steps straight ahead."""
    actions = np.tile(np.float32([0.8, 0.1]), (*env.action_space.shape[:-1], 1))
    for _ in range(steps):
        observations, *_ = env.step(actions)
    return {name: np.array(array) for name, array in observations.items()}


def run_in_child(_number):
    """Return what a batch of the child's own sees."""
    return steps_of(make_episodes()[0])


def is_same_in_pool():
    """Return whether children of a forked pool answer, and see what their parent sees.

    Raises
    ------
    multiprocessing.TimeoutError
        Where they do not answer.
    """
    env, _ = make_episodes()
    expected = steps_of(env)
    with multiprocessing.get_context("fork").Pool(2) as pool:
        answers = pool.map_async(run_in_child, range(2)).get(timeout=HANGS_S)
    return all(np.array_equal(answer[name], expected[name]) for answer in answers for name in expected)


def main():
    """Fork pools and print how many failed; the exit code is 1 where any did."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=100)
    count = parser.parse_args().count
    hangs = differences = 0
    for _ in range(count):
        try:
            differences += not is_same_in_pool()
        except multiprocessing.TimeoutError:
            hangs += 1
    print(f"{count} pools: {hangs} hang, {differences} see something else")
    return int(hangs + differences > 0)


if __name__ == "__main__":
    sys.exit(main())
