"""Decisions by frontiers: what is offered, what a choice does, and how it ends."""

import gymnasium
import numpy as np
import pytest

import lidarium
from lidarium.envs.floors.floor import Floor, Solid
from lidarium.envs.settings.exploration import ExplorationSettings

MOST = ExplorationSettings().frontiers


def wall(x, y, width, height):
    return Solid(np.array([[x, y], [x + width, y], [x + width, y + height], [x, y + height]]))


ROOMS = Floor(
    "rooms",
    (0.0, 0.0, 7.0, 4.0),
    (wall(3.4, 0.0, 0.2, 1.5), wall(3.4, 2.5, 0.2, 1.5)),
    starts=np.array([[1.0, 1.0, 0.5], [1.0, 3.0, -0.5]]),
)


def make(floor=ROOMS, **options):
    return lidarium.parallel_env(
        floor,
        level="frontier",
        **{"starts": "fixed", "robots": 2, "stop_coverage": None, "horizon_s": None, "map_cells": 64, **options},
    )


def first_offered(observations):
    return {agent: int(np.flatnonzero(observation["action_mask"])[0]) for agent, observation in observations.items()}


def run(env, choose=first_offered, limit=200, seed=0):
    observations, _ = env.reset(seed=seed)
    for _ in range(limit):
        outcome = env.step(choose({agent: observations[agent] for agent in env.agents}))
        observations = outcome[0]
        if not env.agents:
            return outcome
    raise AssertionError("the episode did not end")


@pytest.mark.parametrize("robots", [1, 2])
def test_the_nearest_frontier_each_time_explores_nearly_all_and_ends_with_a_reason(robots):
    env = make(robots=robots)
    outcome = run(env)
    base = env.unwrapped
    assert base.scorer.coverage >= 0.98
    assert set(base.scorer.ended_because.values()) <= {"no_frontier", "frontier_unreachable"}
    assert all(outcome[2].values())
    assert base.world.collisions.sum() == 0


def test_frontiers_are_offered_cheapest_first_with_zeros_behind_the_last():
    env = make()
    observations, _ = env.reset(seed=0)
    for _ in range(4):
        for observation in observations.values():
            table, mask = observation["frontiers"], observation["action_mask"]
            count = int(mask[:MOST].sum())
            assert mask[MOST] == 1
            assert mask[:count].all()
            assert (np.diff(table[:count, 2]) >= 0.0).all()
            assert (table[:count, 3] > 0.0).all()
            assert not table[count:].any()
            # No way is shorter than the straight line to its end, up to the cells.
            assert (table[:count, 2] >= np.hypot(*table[:count, :2].T) - 0.1).all()
        observations = env.step(first_offered(observations))[0]


def test_a_choice_drives_to_where_the_frontier_was_offered():
    env = make(robots=1)
    observations, _ = env.reset(seed=0)
    place = env.unwrapped.world.poses[0, :2].copy()
    offered = observations["robot_0"]["frontiers"][0, :2].astype(float)
    env.step({"robot_0": 0})
    path = env.driver.path(0)
    assert (
        path[-1] + env.unwrapped.perception.poses.offset(0) == pytest.approx(place + offered, abs=0.08)
        or len(path) == 1
    )


def test_staying_and_what_the_mask_rules_out_stay():
    env = make(robots=1)
    observations, _ = env.reset(seed=0)
    place = env.unwrapped.world.poses.copy()
    ruled_out = int(np.flatnonzero(observations["robot_0"]["action_mask"] == 0)[0])
    for action in (MOST, ruled_out):
        env.step({"robot_0": action})
        assert np.array_equal(env.unwrapped.world.poses, place)


@pytest.mark.parametrize("action", [-1, MOST + 1, 99])
def test_a_number_that_is_no_candidate_is_refused(action):
    env = make(robots=1)
    env.reset(seed=0)
    with pytest.raises(ValueError, match=f"action of robot_0 is {action}; want a frontier from 0 to 31, or 32 to stay"):
        env.step({"robot_0": action})


def test_a_missing_choice_is_refused_by_name():
    env = make()
    env.reset(seed=0)
    with pytest.raises(ValueError, match="no action for robot_1"):
        env.step({"robot_0": 0})


def test_a_frontier_that_cannot_be_seen_is_offered_no_more():
    """A crack too narrow to look through leaves a frontier that does not go away."""
    floor = Floor(
        "crack",
        (0.0, 0.0, 5.0, 4.0),
        (wall(3.0, 0.0, 0.2, 1.9), wall(3.0, 2.1, 0.2, 1.9)),
        starts=np.array([[1.0, 1.0, 0.5]]),
    )
    env = make(floor, robots=1)
    run(env)
    assert env.unwrapped.scorer.ended_because["robot_0"] == "frontier_unreachable"
    assert env.unwrapped.scorer.coverage == 1.0


def test_random_choices_end_as_well():
    generator = np.random.default_rng(0)

    def choose(observations):
        return {
            agent: int(generator.choice(np.flatnonzero(observation["action_mask"][:MOST])))
            if observation["action_mask"][:MOST].any()
            else MOST
            for agent, observation in observations.items()
        }

    env = make()
    run(env, choose)
    assert env.unwrapped.scorer.coverage >= 0.95
    assert env.unwrapped.world.collisions.sum() == 0


def test_a_robot_that_is_stopped_ends_and_the_other_goes_on():
    env = make()
    observations, _ = env.reset(seed=0)
    env.stop("robot_0", "stopped")
    outcome = env.step({"robot_1": first_offered(observations)["robot_1"]})
    assert outcome[4]["robot_0"]["ended_because"] == "stopped"
    assert env.agents == ["robot_1"]
    observations = {agent: outcome[0][agent] for agent in env.agents}
    env.step(first_offered(observations))


def test_on_their_own_maps_robots_explore_twice():
    from lidarium.envs.faces.parallel import ExplorationEnv
    from lidarium.envs.settings.making import make_settings

    shares = []
    for shares_map in (True, False):
        base = ExplorationEnv(ROOMS, make_settings(robots=2, stop_coverage=None, horizon_s=None, map_cells=64))
        base.use_level("frontier", shares_map)
        run(base)
        shares.append(float((base.score.seen / base.score.counted[0]).min()))
    assert shares[1] >= 0.97
    assert shares[0] <= shares[1]


def table_of(observations):
    """What a lone robot is offered, a row for each."""
    seen = observations["robot_0"]
    return seen["frontiers"][: seen["action_mask"][:-1].sum()]


def offered(seed=0, decisions=12, **options):
    """The tables of a robot that takes the first offer of 256, whatever is offered beside."""
    env = make("building:17", robots=1, frontiers=256, frontiers_by_size=0.0, least_frontier=0.0)
    other = make("building:17", robots=1, **options)
    tables = []
    observations, own = env.reset(seed=seed)[0], other.reset(seed=seed)[0]
    for _ in range(decisions):
        tables.append((table_of(observations), table_of(own)))
        place = tables[-1][0][0, :2]
        is_same = (tables[-1][1][:, :2] == place).all(axis=1)
        if not is_same.any():
            break
        observations = env.step({"robot_0": 0})[0]
        own = other.step({"robot_0": int(np.flatnonzero(is_same)[0])})[0]
    return tables


def test_the_longest_frontier_is_always_on_offer():
    for every, own in offered(frontiers=2, least_frontier=0.0):
        assert every[:, 3].max() == own[:, 3].max()
        assert own[0].tolist() == every[0].tolist()


def test_short_frontiers_are_offered_only_where_there_is_no_longer_one():
    for every, own in offered(frontiers=256):
        is_long = every[:, 3] >= 0.5 - 1e-6
        wanted = every[is_long] if is_long.any() else every
        assert own.tolist() == wanted.tolist()
    least = 1000.0
    for every, own in offered(frontiers=256, least_frontier=least, decisions=4):
        assert own.tolist() == every.tolist()


@pytest.mark.filterwarnings("ignore:.*is out of date:DeprecationWarning")
def test_version_0_of_the_id_offers_what_it_did():
    env = gymnasium.make("lidarium/FrontierExploration-v0")
    assert env.action_space.n == 17
    assert env.unwrapped.parallel.settings.least_frontier == 0.1
    assert gymnasium.make("lidarium/FrontierExploration-v1").action_space.n == MOST + 1
