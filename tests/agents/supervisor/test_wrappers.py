"""A supervisor around environments: learners and policies decide for robots that have no order."""

import numpy as np
import pytest
from gymnasium.vector import SyncVectorEnv
from pettingzoo.test import parallel_api_test

import lidarium
from lidarium.agents.supervisor.supervisor import Command
from lidarium.agents.supervisor.wrappers import DIRECTED
from lidarium.envs.onboard.radio.messages import OrderKind

UNKNOWN = {"robots": 2, "resolution": 0.1, "known_starts": False, "map_cells": 64}


def greedy(env, observations, agents):
    """Take the first frontier on offer, else stay."""
    return {agent: int(np.argmax(observations[agent]["action_mask"])) for agent in agents}


def test_the_wrapper_has_the_parallel_api():
    parallel_api_test(
        lidarium.Supervised(
            lidarium.parallel_env("apartment", level="frontier", horizon_s=10.0, **UNKNOWN, starts="fixed")
        ),
        10,
    )


def test_a_policy_inside_the_wrapper_explores_as_the_supervised_policy():
    ended = []
    inner = lidarium.policy("nearest_frontier")
    wrapped = lidarium.Supervised(
        lidarium.parallel_env("apartment", level="waypoint", horizon_s=32.0, **UNKNOWN, starts="fixed")
    )
    observations, _ = wrapped.reset(seed=4)
    inner.reset(wrapped, seed=4)
    while wrapped.agents:
        observations, *_ = wrapped.step(inner.act(observations))
        observations = {agent: observations[agent] for agent in wrapped.agents}
    ended.append(wrapped.unwrapped)
    other = lidarium.parallel_env("apartment", horizon_s=32.0, **UNKNOWN, starts="fixed")
    supervised = lidarium.Supervised(lidarium.policy("nearest_frontier"))
    lidarium.run_episode(supervised, other, seed=4)
    assert wrapped.supervisor.joins
    assert {(join.a, join.b) for join in wrapped.supervisor.joins} == {(join.a, join.b) for join in supervised.joins}
    assert wrapped.unwrapped.scorer.coverage == pytest.approx(other.scorer.coverage, abs=0.05)


def test_robots_that_are_directed_follow_their_orders_and_masks_say_so():
    env = lidarium.Supervised(
        lidarium.parallel_env("apartment", level="frontier", **UNKNOWN, starts="fixed"),
        masks_orders=True,
        period_s=4.0,
    )
    observations, infos = env.reset(seed=2)
    directed = 0
    while env.agents and env.unwrapped.time_s < 90.0:
        for agent in env.agents:
            if infos[agent]["directed"]:
                directed += 1
                mask = observations[agent]["action_mask"]
                assert mask[-1] == 1
                assert mask.sum() == 1
        observations, _, _, _, infos = env.step(greedy(env, observations, env.agents))
    assert directed > 0
    assert env.supervisor.joins, "the maps of robots with unknown starts are joined"
    orders = [decision for decision in env.supervisor.decisions if decision.order == "go_to"]
    taken = [event for event in env.unwrapped.operating.events[0] if event.kind == "order" and event.what == "go_to"]
    assert bool(orders) == bool(taken)


@pytest.mark.parametrize("level", ["velocity", "waypoint", "frontier"])
def test_a_batch_is_supervised_as_its_episodes_are_alone(level):
    options = {"level": level, "horizon_s": 16.0, **UNKNOWN}
    batch = lidarium.Supervised(
        lidarium.vector_env(2, "apartment", reports=True, **{"starts": "fixed", **options}), period_s=4.0
    )
    alone = [
        lidarium.Supervised(lidarium.parallel_env("apartment", **{"starts": "fixed", **options}), period_s=4.0)
        for _ in range(2)
    ]
    observations, infos = batch.reset(seed=7)
    for episode, env in enumerate(alone):
        env.reset(seed=7 + episode)
    generator = np.random.default_rng(0)
    while all(env.agents for env in alone):
        if level == "frontier":
            actions = observations["action_mask"].argmax(axis=1)
        else:
            actions = generator.uniform(-1.0, 1.0, (4, 2)).astype(np.float32)
        for episode, env in enumerate(alone):
            rows = {agent: 2 * episode + robot for robot, agent in enumerate(env.possible_agents)}
            _, _, _, _, own = env.step({agent: actions[rows[agent]] for agent in env.agents})
            poses = env.unwrapped.world.poses
            expected = {agent: info["directed"] for agent, info in own.items()}
            if episode == 0:
                observations, _, _, truncated, infos = batch.step(actions)
            assert np.array_equal(batch.unwrapped.engine.world.poses[2 * episode : 2 * episode + 2], poses)
            if not truncated.any():
                assert {agent: infos["directed"][rows[agent]] for agent in expected} == expected


def test_robots_that_have_ended_are_not_directed():
    options = {"level": "frontier", "horizon_s": 3.0, **UNKNOWN, "starts": "fixed"}
    env = lidarium.Supervised(lidarium.parallel_env("apartment", **options))
    observations, infos = env.reset(seed=0)
    while env.agents:
        observations, _, _, _, infos = env.step(greedy(env, observations, env.agents))
    assert [info["directed"] for info in infos.values()] == [False, False]
    batch = lidarium.Supervised(lidarium.vector_env(1, "apartment", reports=True, **options))
    observations, _ = batch.reset(seed=0)
    truncated = np.zeros(2, np.bool_)
    while not truncated.all():
        observations, _, _, truncated, infos = batch.step(observations["action_mask"].argmax(axis=1))
    assert not infos["directed"].any()


def test_episodes_of_a_batch_that_begin_again_are_supervised_anew():
    batch = lidarium.Supervised(
        lidarium.vector_env(2, "apartment", level="frontier", reports=True, horizon_s=3.0, **UNKNOWN, starts="fixed")
    )
    observations, _ = batch.reset(seed=0)
    endings = 0
    for _ in range(6):
        observations, _, _, truncated, infos = batch.step(observations["action_mask"].argmax(axis=1))
        endings += int(truncated.any())
    assert endings >= 2
    assert infos["directed"].shape == (4,)
    assert all(supervisor.report().supervision is not None for supervisor in batch.supervisors)


def test_teams_whose_settings_are_newly_drawn_are_supervised_alone_and_in_batches():
    options = {"horizon_s": 3.0, "starts": "fixed", **UNKNOWN, "randomize": {"robots": [3, 2]}}
    alone = lidarium.Supervised(lidarium.parallel_env("apartment", **options), period_s=1.0)
    batch = lidarium.Supervised(lidarium.vector_env(1, "apartment", reports=True, **options), period_s=1.0)
    for seed in range(2):
        alone.reset(seed=seed)
        _, infos = batch.reset(seed=seed)
        assert alone.supervisor.report().supervision is not None
        actions = np.tile(np.array([0.4, 0.2], np.float32), (3, 1))
        while alone.agents:
            _, _, _, _, own = alone.step({agent: actions[robot] for robot, agent in enumerate(alone.agents)})
            _, _, _, _, infos = batch.step(actions)
            directed = {agent: bool(infos["directed"][alone.possible_agents.index(agent)]) for agent in own}
            if alone.agents:
                assert directed == {agent: info["directed"] for agent, info in own.items()}
        assert np.array_equal(batch.unwrapped.batch.parts[0].engine.world.poses, alone.unwrapped.world.poses)


def test_rows_for_learners_are_supervised_as_those_of_a_batch():
    pytest.importorskip("stable_baselines3", reason='stable-baselines3 is not installed: extra "rl"')
    options = {"level": "frontier", "reports": True, "horizon_s": 90.0, "starts": "fixed", **UNKNOWN}
    batch = lidarium.Supervised(
        lidarium.vector_env(1, "apartment", autoreset_mode="SameStep", **options), masks_orders=True, period_s=4.0
    )
    rows = lidarium.Supervised(lidarium.sb3_vec_env(1, "apartment", **options), masks_orders=True, period_s=4.0)
    rows.seed(2)
    seen, (wanted, infos) = rows.reset(), batch.reset(seed=2)
    assert [info["directed"] for info in rows.reset_infos] == infos["directed"].tolist()
    orders = endings = 0
    while not (orders and endings):
        np.testing.assert_array_equal(seen["action_mask"], wanted["action_mask"])
        np.testing.assert_array_equal(rows.env_method("action_masks"), wanted["action_mask"] != 0)
        actions = wanted["action_mask"].argmax(axis=1)
        wanted, _, terminated, truncated, infos = batch.step(actions)
        seen, _, dones, row_infos = rows.step(actions)
        assert [info["directed"] for info in row_infos] == infos["directed"].tolist()
        assert (dones == terminated | truncated).all()
        only_stay = (wanted["action_mask"].sum(axis=1) == 1) & (wanted["action_mask"][:, -1] == 1)
        assert only_stay[infos["directed"]].all()
        orders, endings = orders + infos["directed"].sum(), endings + dones.sum()
        assert orders or not endings, "an episode of this seed has orders"


def test_what_cannot_be_supervised_is_refused():
    with pytest.raises(ValueError, match="masks_orders is set, but there are no masks; want level='frontier'"):
        lidarium.Supervised(lidarium.parallel_env("apartment", **UNKNOWN), masks_orders=True)
    with pytest.raises(ValueError, match="make it with reports=True"):
        lidarium.Supervised(lidarium.vector_env(1, "apartment", **UNKNOWN)).reset(seed=0)
    with pytest.raises(ValueError, match=r"want a batch of lidarium.vector_env"):
        lidarium.Supervised(SyncVectorEnv([lambda: __import__("gymnasium").make("CartPole-v1")]))
    with pytest.raises(ValueError, match=r"settings of the supervisor are \{'period_s': 5\}; want SupervisorSettings"):
        lidarium.Supervised(lidarium.parallel_env("apartment", **UNKNOWN), {"period_s": 5})
    with pytest.raises(ValueError, match="Supervised is put around int"):
        lidarium.Supervised(3)


@pytest.mark.parametrize("form", [{"action_mask": "infos"}, {"observation": "flat"}])
def test_forms_without_masks_in_observations_are_refused_at_once(form):
    env = lidarium.parallel_env("apartment", level="frontier", **UNKNOWN, **form)
    with pytest.raises(ValueError, match="masks_orders is set, but there are no masks"):
        lidarium.Supervised(env, masks_orders=True)


def test_talking_robots_are_not_supervised():
    with pytest.raises(ValueError, match="comm is 2; want 0 under a supervisor"):
        lidarium.Supervised(lidarium.parallel_env("apartment", comm=2, **UNKNOWN))


def test_a_supervised_policy_can_be_copied():
    import copy
    import pickle

    policy = lidarium.Supervised(lidarium.policy("nearest_frontier"), period_s=4.0)
    for copied in (copy.deepcopy(policy), pickle.loads(pickle.dumps(policy))):
        assert copied.settings == policy.settings
        assert copied.level == policy.level


@pytest.mark.parametrize("begins_another", [False, True])
def test_an_order_is_sent_although_another_episode_begins_meanwhile(begins_another):
    env = lidarium.Supervised(
        lidarium.vector_env(2, "srt_corridor", level="frontier", robots=1, known_starts=False, reports=True),
        period_s=4.0,
    )
    env.reset(seed=0)
    stop = Command("robot_0", OrderKind.STOP, 5, "done")
    env.supervisors[1]._supervisor.decide = lambda time_s, given_up: [stop] if time_s < 4.5 else []
    stay = np.full(2, env.single_action_space.n - 1)
    infos = {DIRECTED: [False, False]}
    while not infos[DIRECTED][1]:
        infos = env.step(stay)[-1]
    if begins_another:
        _, infos = env.reset(options={"episodes": np.array([True, False])})
        assert infos[DIRECTED].tolist() == [False, True]
    assert env.step(stay)[-1]["state"][1] == "stopped"
    env.close()
