"""Runs of the sensor-based random tree: it reaches goals, explores, comes home, and says why it ended."""

import math
from functools import lru_cache

import numpy as np
import pytest

import lidarium
from lidarium.agents.policy import Stop
from lidarium.agents.srt.explorer import Explorer
from lidarium.agents.srt.memories import MapMemory
from lidarium.agents.srt.policy import SensorBasedRandomTree
from lidarium.envs.floors.floor import Floor, Solid
from lidarium.envs.settings.lidar import Lidar
from lidarium.evaluation.episodes.runner import run_episode

WALL = Solid(np.array([[2.0, 0.0], [2.2, 0.0], [2.2, 1.7], [2.0, 1.7]]))
PILLAR = Solid(np.array([[3.2, 1.2], [3.5, 1.2], [3.5, 1.5], [3.2, 1.5]]))
ROOM = Floor("room", (0.0, 0.0, 4.5, 3.0), (WALL, PILLAR), starts=np.array([[0.8, 0.8, 0.0]]))
"""A small room, of which a part is behind a wall."""


@lru_cache
def finished(floor, robots=1, mode="default", seed=1, robot="pioneer", horizon_s=900.0, **chosen):
    env = lidarium.parallel_env(
        floor, robots=robots, robot=robot, horizon_s=horizon_s, stop_coverage=None, map_cells=32, starts="fixed"
    )
    return run_episode(SensorBasedRandomTree(mode, **chosen), env, seed)


def away_from_start(episode):
    """How far each robot is from the nearest of the floor's starts [m]."""
    starts = np.asarray(episode.env.floor.starts)
    return [min(math.dist(pose[:2], start[:2]) for start in starts) for pose in episode.env.world.poses]


@pytest.mark.parametrize(
    "floor", ["srt_corridor", "srt_l_room", "srt_lab", "srt_t_junction", "srt_cluttered_reachable"]
)
def test_the_goal_of_each_world_is_reached_without_contact(floor):
    env = finished(floor).env
    assert env.scorer.ended_because == {"robot_0": "reached"}
    assert env.world.collisions.sum() == 0


def test_an_enclosed_goal_is_unreachable_and_the_robot_is_back_at_its_start():
    episode = finished("srt_cluttered")
    assert episode.env.scorer.ended_because == {"robot_0": "unreachable"}
    assert episode.env.scorer.coverage > 0.99
    assert max(away_from_start(episode)) < 0.2


def test_without_a_goal_a_room_is_explored_and_the_robot_is_back_at_its_start():
    episode = finished(ROOM, robot="kobuki")
    assert episode.env.scorer.ended_because == {"robot_0": "explored"}
    assert episode.env.scorer.coverage > 0.98
    assert max(away_from_start(episode)) < 0.2


@pytest.mark.parametrize("budget", [("nodes", 3), ("time_s", 15.0)])
def test_a_spent_budget_sends_the_robot_home(budget):
    episode = finished("srt_cluttered", **{budget[0]: budget[1]})
    assert episode.env.scorer.ended_because == {"robot_0": "budget"}
    assert max(away_from_start(episode)) < 0.2
    assert episode.env.world.travelled[0] > 0.5


def test_the_printed_form_of_the_thesis_runs_and_comes_home():
    episode = finished("srt_cluttered", mode="thesis")
    assert episode.env.scorer.ended_because == {"robot_0": "unreachable"}
    assert max(away_from_start(episode)) < 0.3


@pytest.mark.parametrize("floor", ["srt_corridor", "srt_l_room", "srt_lab", "srt_t_junction"])
def test_the_printed_form_reaches_the_goals_that_the_thesis_reached(floor):
    assert finished(floor, mode="thesis").env.scorer.ended_because == {"robot_0": "reached"}


def test_the_printed_form_sees_a_node_anew_when_it_comes_back_and_keeps_its_parent():
    nodes = finished("srt_cluttered", mode="thesis").policy.tree.nodes
    again = [
        (first, second)
        for first in nodes
        for second in nodes[first.number + 1 :]
        if np.array_equal(first.place, second.place)
    ]
    assert again
    assert all(first.parent == second.parent for first, second in again)
    assert any(not np.array_equal(first.view, second.view, equal_nan=True) for first, second in again)


@pytest.mark.parametrize(
    "chosen",
    [
        {"shape": "ball"},
        {"shape": "star", "candidates": "random"},
        {"candidates": "farthest", "memory": "regions"},
        {"drive": "controls"},
        {"algorithm": "base", "memory": "regions", "nodes": 12},
        {"backtrack": "parent"},
    ],
    ids=str,
)
def test_all_forms_end_with_a_reason(chosen):
    env = finished("srt_lab", horizon_s=200.0, **chosen).env
    assert set(env.scorer.ended_because.values()) <= {"reached", "unreachable", "budget"}
    assert env.world.collisions.sum() == 0


def test_every_chain_of_parents_ends_at_the_first_node():
    tree = finished("srt_cluttered").policy.tree
    for node in tree.nodes:
        assert tree.chain(node.number)[-1] == 0


def test_no_edge_of_the_tree_crosses_what_stands_there():
    episode = finished(ROOM, robot="kobuki")
    env, tree = episode.env, episode.policy.tree
    belief = env.belief("robot_0")
    origin = np.array(belief.map_origin) + env.world.poses[0, :2] - belief.pose[:2]
    raster = env.floor.raster(0.01, 0.3, 0.3)
    edges = [(tree.nodes[node.parent].place, node.place) for node in tree.nodes if node.parent is not None]
    assert edges
    for start, end in edges:
        points = origin + start + (end - start) * np.linspace(0.0, 1.0, 200)[:, None]
        columns, rows = np.floor((points - np.array(raster.origin[:2])) / raster.resolution).astype(int).T
        assert (raster.solid[rows, columns] == 0).all()


def test_a_goal_in_sight_of_the_first_node_is_reached_in_one_move():
    env = lidarium.parallel_env(
        "srt_cluttered", robots=1, robot="pioneer", horizon_s=60.0, stop_coverage=None, map_cells=32, starts="fixed"
    )
    tree = run_episode(SensorBasedRandomTree(), env, 1, {"goal": (0.9, 0.6)}).policy.tree
    assert env.scorer.ended_because == {"robot_0": "reached"}
    assert len(tree.nodes) == 1


def test_a_team_shares_one_graph_and_all_come_home():
    episode = finished("apartment", robots=2, robot="kobuki")
    env, tree = episode.env, episode.policy.tree
    assert set(env.scorer.ended_because.values()) == {"explored"}
    assert env.scorer.coverage > 0.98
    assert {node.agent for node in tree.nodes} == {"robot_0", "robot_1"}
    bridges = [
        (node.number, other)
        for node in tree.nodes
        for other in node.neighbours
        if tree.nodes[other].agent != node.agent
    ]
    assert bridges
    assert (env.world.travelled > 5.0).all()


def test_robots_that_do_not_know_their_starts_keep_graphs_of_their_own():
    env = lidarium.parallel_env(
        "scene_room", robots=2, known_starts=False, horizon_s=15.0, stop_coverage=None, map_cells=32, starts="fixed"
    )
    tree = run_episode(SensorBasedRandomTree(), env, 2).policy.tree
    assert all(tree.nodes[other].agent == node.agent for node in tree.nodes for other in node.neighbours)


def test_the_same_seed_gives_the_same_run():
    first = finished("srt_cluttered_reachable")
    second = finished.__wrapped__("srt_cluttered_reachable")
    assert np.array_equal(first.env.world.poses, second.env.world.poses)
    assert first.env.scorer.curve == second.env.scorer.curve
    assert [node.pose.tolist() for node in first.policy.tree.nodes] == [
        node.pose.tolist() for node in second.policy.tree.nodes
    ]


@pytest.mark.parametrize(
    "chosen",
    [{}, {"candidates": "random"}, {"candidates": "farthest"}, {"algorithm": "base"}, {"random_share": 1.0}],
)
def test_only_explorers_that_choose_the_least_cost_plan_tours(chosen, monkeypatch):
    planned = []
    monkeypatch.setattr("lidarium.agents.srt.choice._first_on_tour", lambda *_: planned.append(1))
    env = lidarium.parallel_env("apartment", robots=1, robot="pioneer", horizon_s=30.0, starts="fixed")
    run_episode(SensorBasedRandomTree(**chosen), env, 0)
    assert bool(planned) == (not chosen)


def test_a_robot_that_teammates_keep_from_their_goal_ends_as_blocked_and_makes_room():
    env = lidarium.parallel_env(
        "srt_lab", robots=3, localization="splines", horizon_s=400.0, stop_coverage=None, starts="fixed"
    )
    run_episode(SensorBasedRandomTree(), env, 0)
    assert sorted(env.scorer.ended_because.values()) == ["blocked", "reached", "reached"]
    assert env.scorer.time < 200.0


class Seen(SensorBasedRandomTree):
    """A tree whose robots see what a test makes of their scans."""

    def __init__(self, change):
        super().__init__()
        self._change = change

    def act(self, observations):
        return super().act(
            {agent: {**each, "scan": self._change(each["scan"])} for agent, each in observations.items()}
        )


def all_beams(value):
    return lambda scan: np.full_like(scan, value)


def every_third_below_the_minimum(scan):
    changed = scan.copy()
    changed[::3] = 0.01
    return changed


@pytest.mark.parametrize("value", [math.nan, 0.0, 0.01])
def test_a_robot_whose_laser_tells_nothing_ends_as_blind(value):
    env = lidarium.parallel_env(
        "scene_room", robots=1, horizon_s=60.0, stop_coverage=None, map_cells=32, starts="fixed"
    )
    run_episode(Seen(all_beams(value)), env, 1)
    assert env.scorer.ended_because == {"robot_0": "blind"}
    assert env.world.travelled[0] < 1e-6


@pytest.mark.parametrize("value", [5.6, math.inf])
def test_scans_without_any_return_are_survived(value):
    env = lidarium.parallel_env(
        "scene_room", robots=1, horizon_s=20.0, stop_coverage=None, map_cells=32, starts="fixed"
    )
    run_episode(Seen(all_beams(value)), env, 1)
    assert set(env.scorer.ended_because.values()) <= {"horizon", "explored"}


def test_ranges_below_the_minimum_do_not_keep_a_robot_from_its_goal():
    env = lidarium.parallel_env(
        "srt_lab", robots=1, robot="pioneer", horizon_s=200.0, stop_coverage=None, map_cells=32, starts="fixed"
    )
    run_episode(Seen(every_third_below_the_minimum), env, 1)
    assert env.scorer.ended_because == {"robot_0": "reached"}


@pytest.mark.parametrize("mode", ["default", "thesis"])
def test_a_laser_of_one_beam_is_no_reason_to_fail(mode):
    one_beam = Lidar(beams=1, field_of_view=0.01, range_max=5.6)
    env = lidarium.parallel_env(
        "scene_room", robots=1, lidar=one_beam, horizon_s=20.0, stop_coverage=None, map_cells=32, starts="fixed"
    )
    run_episode(SensorBasedRandomTree(mode), env, 1)
    assert set(env.scorer.ended_because.values()) <= {"horizon", "explored"}


class Held(SensorBasedRandomTree):
    """A tree whose robots something holds."""

    def act(self, observations):
        wanted = super().act(observations)
        return {
            agent: action if isinstance(action, Stop) else np.zeros(2, np.float32) for agent, action in wanted.items()
        }


class HeldFarAway(Held):
    """A tree whose robot something holds once it is on a way of several legs, after a minute."""

    is_held = False

    def act(self, observations):
        legs = self._explorers["robot_0"]._travel.legs
        self.is_held = self.is_held or (self._team.time_s >= 60.0 and len(legs) > 1)
        act = Held.act if self.is_held else SensorBasedRandomTree.act
        return act(self, observations)


@pytest.mark.parametrize(("budget", "ending"), [({}, "horizon"), ({"time_s": 30.0}, "budget")])
def test_a_robot_that_something_holds_ends_with_a_reason(budget, ending):
    env = lidarium.parallel_env(
        "srt_lab", robots=1, robot="pioneer", horizon_s=90.0, stop_coverage=None, map_cells=32, starts="fixed"
    )
    run_episode(Held(**budget), env, 1)
    assert env.scorer.ended_because == {"robot_0": ending}


def test_what_stops_a_robot_on_its_way_is_not_held_against_a_target_far_away_at_once(monkeypatch):
    blocks, given_up_at, settle, give_up = [], [], Explorer._settle_block, MapMemory.give_up

    def noted(self, senses, memory):
        legs, before = len(self._travel.legs), len(given_up_at)
        settle(self, senses, memory)
        blocks.append((senses.time_s, legs, len(given_up_at) - before))

    def counted(self, focus):
        given_up_at.append(focus)
        give_up(self, focus)

    monkeypatch.setattr(Explorer, "_settle_block", noted)
    monkeypatch.setattr(MapMemory, "give_up", counted)
    env = lidarium.parallel_env(
        "office:44", robots=1, robot="pioneer", horizon_s=150.0, stop_coverage=None, starts="fixed"
    )
    run_episode(HeldFarAway(), env, 1)
    held = np.array([[legs, given_up] for time_s, legs, given_up in blocks if time_s > 60.0])
    legs, given_up = held.T
    assert len(held) >= 15
    assert legs[0] > 1
    # It backs out, steps aside, and only then gives a target up that it is not at.
    assert given_up[:3].sum() == 0
    assert 0 < given_up.sum() <= len(held) // 3


def test_a_robot_that_is_pushed_aside_still_reaches_its_goal():
    env = lidarium.parallel_env(
        "srt_l_room", robots=1, robot="pioneer", horizon_s=200.0, stop_coverage=None, map_cells=32, starts="fixed"
    )
    policy = Pushed(env)
    run_episode(policy, env, 1)
    assert policy.was_pushed
    assert env.scorer.ended_because == {"robot_0": "reached"}


class Pushed(SensorBasedRandomTree):
    """A tree whose robot is pushed aside and turned by somebody after five seconds."""

    def __init__(self, env):
        super().__init__()
        self._env, self.was_pushed = env, False

    def act(self, observations):
        if not self.was_pushed and self._env.scorer.time >= 5.0:
            self._env.world.poses[0] += (0.2, -0.2, 1.0)
            self.was_pushed = True
        return super().act(observations)


@pytest.mark.parametrize(("goal", "told"), [((1.5, 0.0), "inside a wall"), ((60.0, 0.0), "outside of the floor")])
def test_a_goal_in_a_wall_or_outside_is_refused_before_the_run(goal, told):
    env = lidarium.parallel_env("srt_cluttered", robots=1, starts="fixed")
    with pytest.raises(ValueError, match=told):
        run_episode(SensorBasedRandomTree(), env, 1, {"goal": goal})


def test_a_tree_without_a_scan_is_refused():
    env = lidarium.parallel_env("scene_room", robots=1, observe=["pose"], starts="fixed")
    with pytest.raises(ValueError, match="needs scan"):
        run_episode(SensorBasedRandomTree(), env, 1)
