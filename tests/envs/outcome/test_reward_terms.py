"""Terms of the reward: reported one by one, and added by users."""

import numpy as np
import pytest

import lidarium
from lidarium.envs.outcome.reward_terms import REWARD_TERMS
from lidarium.envs.scoring.rewards import TERMS

DRIVE = np.array([0.6, 0.5], np.float32)


class Steps:
    """Amount: calls since the start of the episode."""

    def start(self, world, episode):
        self.calls = 0

    def amounts(self, world):
        self.calls += 1
        return np.full(len(world.poses), float(self.calls))


@pytest.fixture
def steps():
    REWARD_TERMS.register("steps", Steps, "for tests")
    yield
    REWARD_TERMS.unregister("steps")


def run(env, steps=8):
    env.reset(seed=2)
    for _ in range(steps):
        _, rewards, _, _, infos = env.step(dict.fromkeys(env.agents, DRIVE))
        yield rewards, infos


def test_terms_make_up_the_reward_and_have_the_signs_of_their_names():
    for rewards, infos in run(lidarium.parallel_env("scene_room", robots=2)):
        for agent, reward in rewards.items():
            terms = infos[agent]["reward_terms"]
            assert list(terms) == list(TERMS)
            assert sum(terms.values()) == pytest.approx(reward, abs=1e-12)
            assert terms["area"] >= 0.0
            assert terms["time"] == pytest.approx(-0.001)
            assert max(terms["contact"], terms["energy"]) <= 0.0


@pytest.mark.usefixtures("steps")
def test_a_registered_term_is_weighed_and_reported():
    plain = [rewards for rewards, _ in run(lidarium.parallel_env("scene_room", robots=2))]
    more = list(
        run(lidarium.parallel_env("scene_room", robots=2, reward={"more": {"steps": 10.0, "turning": -1.0}}))
    )
    for number, (before, (rewards, infos)) in enumerate(zip(plain, more, strict=True), 1):
        for agent in rewards:
            terms = infos[agent]["reward_terms"]
            assert terms["steps"] == 10.0 * number
            assert -0.1 * 3.14 < terms["turning"] <= 0.0
            assert rewards[agent] == pytest.approx(before[agent] + terms["steps"] + terms["turning"])
    assert infos["robot_0"]["reward_terms"]["turning"] == pytest.approx(-0.05 * 3.14, rel=0.05)


@pytest.mark.usefixtures("steps")
def test_rows_of_a_batch_earn_what_single_episodes_do():
    options = {"robots": 2, "reward": {"more": {"turning": -1.0}}}
    rows = lidarium.vector_env(2, "scene_room", **options)
    rows.reset(seed=[2, 3])
    singles = run(lidarium.parallel_env("scene_room", **options))
    for rewards, infos in singles:
        _, of_rows, _, _, told = rows.step(np.tile(DRIVE, (4, 1)))
        assert of_rows[:2].tolist() == [rewards["robot_0"], rewards["robot_1"]]
        for name, values in told["reward_terms"].items():
            assert values[:2].tolist() == [
                infos[agent]["reward_terms"][name] for agent in ("robot_0", "robot_1")
            ]


def test_an_unknown_term_is_refused():
    with pytest.raises(ValueError, match="unknown reward term 'turnin'; did you mean 'turning'"):
        lidarium.parallel_env("scene_room", reward={"more": {"turnin": 1.0}})
