"""Functions and options of a user's own: what is not finite, misspelt or in the wrong place is told."""

import numpy as np
import pytest

import lidarium
from lidarium.registry import registry


@pytest.fixture
def registered():
    """Register functions for one test."""
    names = []
    yield names
    for kind, name in names:
        registry(kind).unregister(name)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_reward_that_is_not_finite_is_an_error_that_names_the_robot(registered, value):
    @lidarium.reward_term("broken_reward", summary="is not finite for the second robot")
    def broken(rows):
        return np.where(np.arange(len(rows.poses)) == 1, value, 0.0)

    registered.append(("reward_term", "broken_reward"))
    env = lidarium.parallel_env(
        "scene_room", robots=2, reward={"more": {"broken_reward": 1.0}}, map_cells=64, starts="fixed"
    )
    env.reset(seed=0)
    with pytest.raises(ValueError, match=r"reward term 'broken_reward' of robot_1, episode 0, is (nan|inf)"):
        env.step({agent: env.action_space(agent).sample() for agent in env.agents})


def test_an_observable_that_is_nan_is_an_error_and_infinity_is_clipped(registered):
    values = np.zeros((2, 1))

    @lidarium.observable("broken_view", low=-1.0, high=1.0, shape=(1,), summary="is what the test says")
    def broken(rows):
        return values

    registered.append(("observable", "broken_view"))
    env = lidarium.parallel_env("scene_room", robots=2, observe=("broken_view",), map_cells=64, starts="fixed")
    values[0] = np.inf
    observations, _ = env.reset(seed=0)
    assert observations["robot_0"]["broken_view"] == 1.0
    values[0] = np.nan
    with pytest.raises(ValueError, match=r"observable 'broken_view' of robot_0, episode 0, is .*nan"):
        env.reset(seed=0)


def test_a_cell_of_a_notebook_can_be_run_again(registered):
    def cell():
        @lidarium.reward_term("again_reward", summary="again")
        def reward(rows):
            return np.zeros(len(rows.poses))

        @lidarium.observable("again_view", low=0.0, high=1.0, shape=(1,), summary="again")
        def view(rows):
            return np.zeros((len(rows.poses), 1))

        lidarium.register_policy("again_policy", lambda: lidarium.policy("random_walk"), "again")

    cell()
    registered += [("reward_term", "again_reward"), ("observable", "again_view"), ("policy", "again_policy")]
    with pytest.warns(UserWarning, match="was registered before and is replaced") as warned:
        cell()
    assert len(warned) == 3
    with pytest.raises(ValueError, match="policy 'nearest_frontier' is registered already"):
        lidarium.register_policy("nearest_frontier", lambda: None, "takes the package's name")


@pytest.mark.parametrize(("name", "value"), [("horizon_s", 5), ("robots", 1), ("lidar", "urg")])
def test_a_setting_among_the_options_of_reset_is_told_to_belong_to_the_maker(name, value):
    for env in (
        lidarium.parallel_env("scene_room", robots=1, starts="fixed"),
        lidarium.vector_env(1, "scene_room", robots=1, starts="fixed"),
    ):
        with pytest.raises(ValueError, match=f"{name} is no option of reset, but a setting of the environment"):
            env.reset(options={name: value})


def test_an_unknown_setting_of_a_part_is_named_with_the_nearest_one():
    with pytest.raises(ValueError, match="RewardSettings: unknown setting 'areas'; did you mean 'area'"):
        lidarium.parallel_env("scene_room", reward={"areas": 1})
