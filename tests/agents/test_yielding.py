"""All reference policies slow down near people, those too that drive by themselves."""

import numpy as np
import pytest

import lidarium
from lidarium.envs.onboard.driving.safety_stop import BACKING_GAP, CREEP, YIELD_M, YIELD_PER_M
from lidarium.envs.settings.making import make_settings
from lidarium.envs.simulation.kernels.arrays import PERSON_GAP, YIELDED
from lidarium.evaluation.episodes.runner import run_episode
from lidarium.evaluation.episodes.watching import WatchedExploration, Watcher


class Speeds(Watcher):
    """Notes at which gap to a person in sight each robot was driven how fast."""

    def begin(self, env):
        self.noted, self._gaps = [], env.simulation.safety[:, PERSON_GAP].copy()

    def step(self, env, commands):
        self.noted += zip(self._gaps.tolist(), commands[:, 0].tolist(), strict=True)
        self._gaps = env.simulation.safety[:, PERSON_GAP].copy()


@pytest.mark.parametrize("name", ["nearest_frontier", "srt", "random_walk"])
def test_robots_are_slow_near_people(name):
    speeds = Speeds()
    settings = make_settings(robots=3, people=8, resolution=0.1, horizon_s=60.0)
    env = WatchedExploration("office:1", settings, watchers=[speeds])
    run_episode(lidarium.policy(name), env, 0)
    near = np.array([(gap, speed) for gap, speed in speeds.noted if gap < YIELD_M and speed > 0.0])
    assert len(near) > 20
    assert (near[:, 1] <= np.maximum(YIELD_PER_M * near[:, 0], CREEP) + 1e-6).all()
    assert env.simulation.safety[:, YIELDED].sum() > 0.0


def test_a_share_of_a_speed_is_whole_far_from_people():
    env = lidarium.parallel_env("apartment", robots=1).unwrapped
    env.reset(seed=0)
    belief, safety = env.belief("robot_0"), env.simulation.safety
    assert [belief.yielding(speed) for speed in (0.3, 0.0, -0.05)] == [1.0, 1.0, 1.0]
    safety[0, PERSON_GAP] = 0.4
    assert belief.yielding(0.48) == pytest.approx(0.5)
    assert belief.yielding(0.1) == 1.0
    assert safety[0, YIELDED] == pytest.approx(0.5)
    safety[0, PERSON_GAP] = 0.5 * BACKING_GAP
    assert belief.yielding(-0.05) == 0.0
