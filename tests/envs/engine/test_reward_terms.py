"""Terms of the reward: reported one by one, and added by users."""

import numpy as np
import pytest
from compared_faces import compare_rows

import lidarium
from lidarium.envs.engine.reward_terms import REWARD_TERMS, reward_term
from lidarium.envs.simulation.rewards import TERMS

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
    for rewards, infos in run(lidarium.parallel_env("scene_room", robots=2, starts="fixed")):
        for agent, reward in rewards.items():
            terms = infos[agent]["reward_terms"]
            assert list(terms) == list(TERMS)
            assert sum(terms.values()) == pytest.approx(reward, abs=1e-12)
            assert terms["area"] >= 0.0
            assert terms["time"] == pytest.approx(-0.001)
            assert max(terms["contact"], terms["energy"]) <= 0.0


@pytest.mark.usefixtures("steps")
def test_a_registered_term_is_weighed_and_reported():
    plain = [rewards for rewards, _ in run(lidarium.parallel_env("scene_room", robots=2, starts="fixed"))]
    more = list(
        run(
            lidarium.parallel_env(
                "scene_room", robots=2, reward={"more": {"steps": 10.0, "turning": -1.0}}, starts="fixed"
            )
        )
    )
    for number, (before, (rewards, infos)) in enumerate(zip(plain, more, strict=True), 1):
        for agent in rewards:
            terms = infos[agent]["reward_terms"]
            assert terms["steps"] == 10.0 * number
            assert -0.1 * 3.14 < terms["turning"] <= 0.0
            assert rewards[agent] == pytest.approx(before[agent] + terms["steps"] + terms["turning"])
    assert infos["robot_0"]["reward_terms"]["turning"] == pytest.approx(-0.05 * 3.14, rel=0.05)


def test_an_unknown_term_is_refused():
    with pytest.raises(ValueError, match="unknown reward term 'turnin'; did you mean 'turning'"):
        lidarium.parallel_env("scene_room", reward={"more": {"turnin": 1.0}})


@pytest.fixture
def crowding():
    @reward_term("crowding", "for tests")
    def crowding(rows):
        places = rows.true_pose[:, :2].reshape(rows.episodes, rows.robots, 2)
        gaps = np.linalg.norm(places[:, :, None] - places[:, None], axis=-1)
        return ((gaps < 4.0).sum(axis=-1) > 1).ravel()

    yield
    REWARD_TERMS.unregister("crowding")


@pytest.mark.usefixtures("crowding")
def test_a_plain_function_is_a_term():
    env = lidarium.parallel_env("apartment", robots=3, reward={"more": {"crowding": -0.05}}, starts="fixed")
    for rewards, infos in run(env):
        places = env.world.poses[:, :2]
        for row, agent in enumerate(rewards):
            near = (np.linalg.norm(places - places[row], axis=1) < 4.0).sum() > 1
            assert infos[agent]["reward_terms"]["crowding"] == (-0.05 if near else 0.0)


def test_a_function_of_another_shape_is_refused_by_name():
    def odd(rows):
        return np.zeros(7)

    reward_term("odd", "for tests")(odd)
    try:
        env = lidarium.parallel_env("scene_room", robots=2, reward={"more": {"odd": 1.0}}, starts="fixed")
        env.reset(seed=0)
        with pytest.raises(ValueError, match=r"the reward term 'odd' has shape \(7,\); want \(2,\)"):
            env.step(dict.fromkeys(env.agents, DRIVE))
    finally:
        REWARD_TERMS.unregister("odd")


@pytest.mark.parametrize(
    ("amounts", "words"),
    [
        (np.ones(1), r"the reward term 'odd' has shape \(1,\); want \(2,\)"),
        (np.ones((2, 1)), r"the reward term 'odd' has shape \(2, 1\); want \(2,\)"),
        (None, r"the reward term 'odd' has shape \(\); want \(2,\)"),
        ("much", r"the reward term 'odd' is 'much'; want numbers of shape \(2,\)"),
    ],
)
def test_amounts_that_are_no_number_for_each_row_are_refused_by_name(amounts, words):
    class Odd:
        def start(self, rows, episode):
            pass

        def amounts(self, rows):
            return amounts

    REWARD_TERMS.register("odd", Odd, "for tests")
    try:
        env = lidarium.parallel_env("scene_room", robots=2, reward={"more": {"odd": 1.0}}, starts="fixed")
        env.reset(seed=0)
        with pytest.raises(ValueError, match=words):
            env.step(dict.fromkeys(env.agents, DRIVE))
    finally:
        REWARD_TERMS.unregister("odd")


def test_shares_of_the_floor_add_up_to_what_the_team_has_seen():
    env = lidarium.parallel_env(
        "scene_room", robots=2, stop_coverage=None, reward={"area": 0.0, "more": {"floor_share": 1.0}}, starts="fixed"
    )
    total = 0.0
    for number, (_, infos) in enumerate(run(env, 60)):
        total += sum(info["reward_terms"]["floor_share"] for info in infos.values())
        if number == 0:
            first = env.scorer.curve[0][1]
    assert total == pytest.approx(env.scorer.coverage - first)
    assert total > 0.01


def test_completion_is_paid_once_and_the_first_view_in_the_first_step():
    env = lidarium.parallel_env(
        "scene_room",
        robots=2,
        stop_coverage=0.02,
        reward={"more": {"completion": 5.0, "first_view": 1.0}},
        starts="fixed",
    )
    env.reset(seed=2)
    seen = env.score.seen.copy() * env.settings.occupancy.resolution**2
    views, completions = [], []
    while env.agents:
        infos = env.step(dict.fromkeys(env.agents, DRIVE))[4]
        views.append([info["reward_terms"]["first_view"] for info in infos.values()])
        completions.append([info["reward_terms"]["completion"] for info in infos.values()])
    assert views[0] == pytest.approx(seen.tolist())
    assert not np.any(views[1:])
    assert completions[-1] == [5.0, 5.0]
    assert not np.any(completions[:-1])


@pytest.mark.usefixtures("crowding")
@pytest.mark.parametrize("level", ["velocity", "frontier"])
def test_terms_of_a_batch_are_those_of_single_episodes(level):
    more = {"crowding": -0.1, "floor_share": 1.0, "completion": 2.0, "first_view": 0.1, "turning": -0.1}
    compare_rows(level, 2, 40, ["apartment", "clinic"], reward={"more": more}, stop_coverage=0.3, seed=7)
