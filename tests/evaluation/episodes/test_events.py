"""Events of an episode in words: orders, states, merges, groups."""

import json

import numpy as np
import pytest

from lidarium.agents import Policy
from lidarium.agents.report import Join, PolicyReport, Supervision
from lidarium.envs.faces.merged_maps import MergingSettings
from lidarium.envs.floors.floor import Floor
from lidarium.envs.onboard.radio.messages import Order, OrderKind, Target
from lidarium.envs.settings.making import make_settings
from lidarium.evaluation.episodes.events import joined_groups
from lidarium.evaluation.episodes.result import result_of
from lidarium.evaluation.episodes.runner import run_episode
from lidarium.evaluation.episodes.watching import WatchedExploration
from lidarium.evaluation.record import Recorder, read_record, rerun, write_record
from lidarium.mapping.geometry.rigid import Transform

HALL = Floor("hall", (0.0, 0.0, 20.0, 12.0))
STARTS = [[3.0, 3.0, 0.0], [3.0, 9.0, np.pi / 2]]


class Scripted(Policy):
    """Does at each decision what a table says; else drives ahead."""

    level, shares_map = "velocity", False

    def __init__(self, orders, turning=0.1):
        self.orders, self.ahead = orders, np.array([0.5, turning], np.float32)

    def reset(self, team, seed):
        self.step = 0

    def act(self, observations):
        chosen = self.orders.get(self.step, {})
        self.step += 1
        return {agent: chosen.get(agent, self.ahead) for agent in observations}


def run(orders, merging=None, turning=0.1, starts=STARTS, **options):
    recorder = Recorder("scripted", 0)
    settings = make_settings(
        **{"robots": 2, "lidar": "lidar_360_6m", "stop_coverage": None, "known_starts": False, **options}
    )
    env = WatchedExploration(HALL, settings, watchers=[recorder])
    episode = run_episode(Scripted(orders, turning), env, 0, {"starts": starts}, merging=merging)
    return episode, recorder.finish()


def of_kinds(events, *kinds):
    return [event for event in events if event["kind"] in kinds]


@pytest.fixture(scope="module")
def ordered():
    """An episode with every kind of event of orders, and its record."""
    orders = {
        2: {"robot_0": Order(OrderKind.PAUSE, reason="wait")},
        3: {"robot_0": Order(OrderKind.EXPLORE)},
        6: {"robot_0": Order(OrderKind.RESUME)},
        9: {"robot_1": Order(OrderKind.GO_TO, Target(500.0, 1.0))},
        12: {"robot_0": Order(OrderKind.STOP, reason="enough"), "robot_1": Order(OrderKind.STOP)},
    }
    return run(orders)


def test_orders_and_states_are_in_the_result_with_places_in_the_floors_frame(ordered):
    result = json.loads(json.dumps(result_of(ordered[0]), allow_nan=False))
    first = {"time_s": 0.2, "agent": "robot_0"}
    assert result["operating"][:3] == [
        {**first, "kind": "order", "order": "pause", "reason": "wait"},
        {**first, "kind": "state", "state": "paused", "reason": "order"},
        {**first, "time_s": 0.3, "kind": "refused", "order": "explore", "reason": "paused"},
    ]
    (refused,) = [event for event in result["operating"] if event["agent"] == "robot_1" and event["kind"] == "refused"]
    # Its map frame begins at (3, 9), a quarter turned.
    assert refused == {
        "time_s": 0.9,
        "kind": "refused",
        "agent": "robot_1",
        "order": "go_to",
        "x": 2.0,
        "y": 509.0,
        "reason": "outside",
    }
    assert result["energy_j"] is None


def test_a_record_tells_them_and_they_come_back_from_its_file(ordered, tmp_path):
    episode, record = ordered
    write_record(tmp_path / "episode.npz", record)
    events = read_record(tmp_path / "episode.npz").display.events
    assert of_kinds(events, "order", "state", "refused", "lost") == result_of(episode)["operating"]
    assert [event["time_s"] for event in events] == sorted(event["time_s"] for event in events)


def test_an_episode_with_pauses_runs_again_to_the_bit(ordered):
    rerun(ordered[1], HALL)


def test_an_episode_in_which_robots_paused_by_themselves_runs_again_to_the_bit():
    orders = {step: {"robot_0": Order(OrderKind.RESUME)} for step in (60, 90, 110)}
    episode, record = run(
        orders, turning=0.0, starts=[[18.5, 3.0, 0.0], STARTS[1]], pauses_when_blocked=True, horizon_s=12.0
    )
    reasons = [event["reason"] for event in result_of(episode)["operating"] if event.get("state") == "paused"]
    assert reasons.count("contact") >= 3
    rerun(record, HALL)


def test_an_episode_that_ends_with_empty_batteries_runs_again_to_the_bit_and_tells_its_energy():
    from lidarium.envs.settings.battery import Battery

    episode, record = run({}, battery=Battery(capacity_j=20.0))
    result = result_of(episode)
    assert set(result["ended_because"].values()) == {"battery"}
    assert min(result["energy_j"]) >= 20.0
    rerun(record, HALL)


def test_merges_are_in_the_record():
    episode, record = run({}, merging=MergingSettings(known_starts=True), horizon_s=3.0)
    (merge,) = of_kinds(record.display.events, "merge")
    assert (merge["agent"], merge["other"], merge["time_s"]) == (
        "robot_0",
        "robot_1",
        episode.merges[0].time_s,
    )
    assert merge["error_m"] == pytest.approx(0.0, abs=1e-6)
    # Where robot_1 was then.
    assert (merge["x"], merge["y"]) == pytest.approx((3.0, 9.0), abs=0.1)


AGENTS = [f"robot_{robot}" for robot in range(4)]


def report(*pairs, unused=()):
    joins = [
        Join(1.0, AGENTS[a], AGENTS[b], Transform(), (0.0, 0.0), is_used=(a, b) not in unused)
        for a, b in (*pairs, *unused)
    ]
    return PolicyReport((), Supervision(joins=joins))


def test_without_a_station_all_are_alone():
    assert joined_groups(PolicyReport(), AGENTS) == ([{0}, {1}, {2}, {3}], [])


def test_joined_pairs_make_groups():
    groups, pairs = joined_groups(report((0, 2), (3, 2)), AGENTS)
    assert sorted(map(sorted, groups)) == [[0, 2, 3], [1]]
    assert pairs == [(0, 2), (3, 2)]


def test_a_pair_within_a_group_joins_nothing_more():
    groups, pairs = joined_groups(report((0, 1), (1, 2), (0, 2)), AGENTS)
    assert sorted(map(sorted, groups)) == [[0, 1, 2], [3]]
    assert pairs == [(0, 1), (1, 2)]


def test_joins_that_wait_to_be_confirmed_do_not_count():
    assert joined_groups(report(unused=[(0, 1)]), AGENTS)[1] == []
