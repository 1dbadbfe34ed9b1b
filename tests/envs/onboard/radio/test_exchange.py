"""What robots tell each other by radio: nobody knows what has not reached him."""

import numpy as np
import pytest

import lidarium
from lidarium.envs.onboard.radio.exchange import BLOCK_BYTES, HEADER_BYTES, NEVER, POSE_BYTES
from lidarium.envs.settings.faults import Fault, FaultSettings
from lidarium.envs.settings.radio import RadioSettings
from lidarium.evaluation.episodes.runner import run_episode


def started(robots=3, seed=1, **options):
    env = lidarium.parallel_env(
        "apartment", robots=robots, lidar="lidar_360_6m", stop_coverage=None, **{"starts": "fixed", **options}
    )
    env.reset(seed=seed)
    return env


def wander(env, steps, seed=0):
    generator = np.random.default_rng(seed)
    for step in range(steps):
        if step % 10 == 0:
            actions = {
                agent: generator.uniform([0.1, -0.3], [0.5, 0.3]).astype(np.float32) for agent in env.possible_agents
            }
        env.step({agent: actions[agent] for agent in env.agents})


def exchange_of(env):
    return env.perception.exchanges[0]


def set_links(monkeypatch, matrix):
    """Let the robots reach each other as a matrix (or a function of the call's number) says."""
    calls = iter(range(10**6))
    monkeypatch.setattr(
        "lidarium.envs.onboard.radio.exchange.links",
        lambda *_: np.array(matrix(next(calls)) if callable(matrix) else matrix, np.bool_).copy(),
    )


def test_the_ideal_radio_needs_no_exchange():
    assert started().perception.exchanges == []


def test_without_a_radio_robots_know_nothing_of_each_other():
    env = started(radio="none")
    wander(env, 30)
    belief = env.belief("robot_0")
    assert belief.teammates == {}
    assert np.array_equal(belief.shared_map.log_odds, belief.map.log_odds)
    assert exchange_of(env).bytes_sent.tolist() == [0, 0, 0]


def test_who_is_always_linked_knows_what_the_team_knew_at_the_last_exchange(monkeypatch):
    set_links(monkeypatch, ~np.eye(3, dtype=bool))
    env = started(radio=RadioSettings(kind="range"))
    wander(env, 20)
    # Step 20 is one of exchange: all maps are as of now.
    total = np.clip(np.sum(np.stack(env.beliefs.log_odds).astype(int), axis=0), -127, 127)
    for agent in env.possible_agents:
        assert np.array_equal(np.sign(env.belief(agent).shared_map.log_odds), np.sign(total))
    teammate = env.belief("robot_0").teammates["robot_2"]
    assert teammate.age_s == 0.0
    assert np.allclose(teammate.pose[:2] + env.perception.poses.offset(0), env.world.poses[2, :2])


def test_a_link_works_one_way_where_it_is_one_way(monkeypatch):
    set_links(monkeypatch, [[0, 1, 0], [0, 0, 0], [0, 0, 0]])
    env = started(radio=RadioSettings(kind="range"))
    wander(env, 15)
    exchange = exchange_of(env)
    assert exchange.heard_at[1, 0] == 15
    assert exchange.heard_at[0, 1] == NEVER
    assert env.belief("robot_0").teammates == {}
    assert set(env.belief("robot_1").teammates) == {"robot_0"}


def test_news_travels_on_over_who_meets_later(monkeypatch):
    first, then = [[0, 1, 0], [1, 0, 0], [0, 0, 0]], [[0, 0, 0], [0, 0, 1], [0, 1, 0]]
    set_links(monkeypatch, lambda call: first if call <= 12 else then)
    env = started(radio=RadioSettings(kind="range"))
    wander(env, 10)
    known_then = exchange_of(env).copies[1][0].copy()
    wander(env, 15)
    exchange = exchange_of(env)
    # Robot 2 never met robot 0, but has what robot 1 brought along.
    assert exchange.copied_at[2, 0] == 10
    assert np.array_equal(exchange.copies[2][0], known_then)
    assert exchange.heard_at[2, 0] == NEVER


def test_what_is_sent_is_counted_by_blocks_that_changed(monkeypatch):
    set_links(monkeypatch, [[0, 1], [0, 0]])
    env = started(robots=2, radio=RadioSettings(kind="range"))
    blocks = (env.beliefs.log_odds[0].reshape(-1, 64) != 0).any(axis=1).sum()
    assert exchange_of(env).bytes_sent.tolist() == [POSE_BYTES + HEADER_BYTES + BLOCK_BYTES * blocks, 0]
    for _ in range(9):
        env.step({agent: np.zeros(2, np.float32) for agent in env.agents})
    assert exchange_of(env).bytes_sent[0] == 10 * POSE_BYTES + HEADER_BYTES + BLOCK_BYTES * blocks


def test_late_messages_come_late_and_whole(monkeypatch):
    set_links(monkeypatch, [[0, 1], [0, 0]])
    env = started(robots=2, radio=RadioSettings(kind="range", latency_s=0.5))
    exchange = exchange_of(env)
    assert exchange.copied_at[1, 0] == NEVER
    first = env.beliefs.log_odds[0].copy()
    wander(env, 5)
    assert exchange.copied_at[1, 0] == 0
    assert np.array_equal(exchange.copies[1][0], first)
    assert exchange.heard_at[1, 0] == 0
    assert env.belief("robot_1").teammates["robot_0"].age_s == pytest.approx(0.5)


def test_lost_messages_are_sent_again_until_they_arrive(monkeypatch):
    set_links(monkeypatch, [[0, 1], [0, 0]])
    env = started(robots=2, radio=RadioSettings(kind="range", loss=0.6))
    told = []
    for _ in range(80):
        wander(env, 1)
        told.append(int(exchange_of(env).heard_at[1, 0]))
    arrivals = len(set(told) - {NEVER})
    assert 15 < arrivals < 50
    assert exchange_of(env).copied_at[1, 0] > NEVER
    assert exchange_of(env).bytes_sent[0] > 80 * POSE_BYTES


def test_a_dead_radio_neither_sends_nor_receives():
    fault = Fault(kind="dead_radio", robot=1, at_s=1.0)
    env = started(radio=RadioSettings(kind="range", reach=1000.0), faults=FaultSettings(schedule=(fault,)))
    wander(env, 30)
    exchange = exchange_of(env)
    assert exchange.heard_at[0, 2] == 30
    assert exchange.heard_at[1].max() < 12
    assert exchange.heard_at[:, 1].max() < 12


def test_the_map_that_reached_a_robot_is_the_sum_of_what_it_holds_at_every_step():
    env = started(radio=RadioSettings(kind="line_of_sight", reach=4.0))
    for k in range(12):
        wander(env, 7, seed=k)
        for robot, agent in enumerate(env.possible_agents):
            held = [copy.astype(int) for copy in exchange_of(env).copies[robot] if copy.size]
            shared = env.belief(agent).shared_map
            total = np.clip(np.sum(held, axis=0), -127, 127)
            assert np.array_equal(np.sign(shared.log_odds), np.sign(total))


@pytest.mark.parametrize("policy", ["nearest_frontier", "utility_frontier"])
@pytest.mark.parametrize("radio", ["none", "range", "signal"])
def test_teams_explore_whatever_reaches_them(policy, radio):
    env = lidarium.parallel_env(
        "apartment", robots=3, radio=RadioSettings(kind=radio, reach=3.0), horizon_s=400.0, starts="fixed"
    )
    run_episode(lidarium.policy(policy), env, seed=5)
    assert env.unwrapped.scorer.coverage >= 0.97
    assert env.unwrapped.world.collisions.sum() <= 3


def test_the_same_seed_is_the_same_traffic():
    def traffic(seed):
        env = started(seed=seed, radio=RadioSettings(kind="signal", shadowing=6.0, loss=0.2, latency_s=0.3))
        wander(env, 40)
        exchange = exchange_of(env)
        return exchange.bytes_sent.tolist(), exchange.heard_at.tolist(), exchange.copied_at.tolist()

    assert traffic(3) == traffic(3)
    assert traffic(3) != traffic(4)
