"""Sparse maps that robots send each other: by radio, relayed, and by the transforms of joined maps."""

import math
from dataclasses import replace

import numpy as np
import pytest

import lidarium
from lidarium.envs.floors.floor import Floor, Solid
from lidarium.envs.onboard.sparse_shares import BOX_BYTES, GROUND_BLOCK_BYTES, NODE_BYTES, SparseShare, bytes_to_send
from lidarium.mapping.geometry.rigid import Transform

SHARE = SparseShare(
    boxes=np.array([[[1.0, 0.0, 0.0], [1.1, 2.0, 0.8]], [[-1.0, 0.0, 0.0], [-0.5, 0.5, 0.3]]]),
    trail=np.zeros((1, 3)),
    free=np.array([[0.5, 0.5, 0.0]]),
    cells=np.ones((10, 20), np.bool_),
    low=np.array([-5, -5]),
    cell_m=0.1,
    axes=0.0,
    version=1,
)


def distances_to(boxes, points):
    """Return how far points (N, 2) are from the nearest of boxes (M, 2, 3) [m]."""
    low, high = boxes[None, :, 0, :2], boxes[None, :, 1, :2]
    gaps = np.maximum(np.maximum(low - points[:, None], points[:, None] - high), 0.0)
    return np.hypot(*np.moveaxis(gaps, -1, 0)).min(axis=1)


def test_a_map_that_is_rotated_by_a_quarter_keeps_its_boxes():
    moved = SHARE.moved(Transform(1.0, 2.0, math.pi / 2.0))
    assert moved.boxes[0] == pytest.approx(np.array([[-1.0, 3.0, 0.0], [1.0, 3.1, 0.8]]))
    assert len(moved.boxes) == 2
    assert moved.free == pytest.approx(np.array([[0.5, 2.5, 0.0]]))
    assert moved.cells.sum() == pytest.approx(200, abs=2)
    assert SHARE.moved(Transform()) is SHARE


@pytest.mark.parametrize("turn", [0.01, 0.1, 0.7, 2.0])
def test_boxes_that_are_rotated_hold_all_that_they_held_and_grow_by_centimetres(turn):
    transform = Transform(0.3, -0.2, turn)
    moved = SHARE.moved(transform)
    places = np.random.default_rng(0).uniform(SHARE.boxes[0, 0, :2], SHARE.boxes[0, 1, :2], (300, 2))
    assert distances_to(moved.boxes, transform.apply(places)).max() < 1e-9
    corners = np.concatenate([moved.boxes[:, 0, :2], moved.boxes[:, 1, :2]])
    back = transform.inverse().apply(corners)
    assert distances_to(SHARE.boxes, back).max() < 0.04
    assert moved.cells.sum() * 0.01 == pytest.approx(2.0, rel=0.05)


def test_bytes_are_those_of_what_is_new_and_of_the_numbers_of_what_is_gone():
    nothing = replace(SHARE, boxes=SHARE.boxes[:0], trail=SHARE.trail[:0], free=SHARE.free[:0], cells=SHARE.cells[:0])
    assert bytes_to_send(None, None) == 0
    assert bytes_to_send(SHARE, SHARE) == 0
    assert bytes_to_send(replace(SHARE, boxes=SHARE.boxes[:1], version=2), SHARE) == 4
    assert bytes_to_send(SHARE, replace(SHARE, boxes=SHARE.boxes[:1], version=0)) == BOX_BYTES
    more = replace(SHARE, free=np.array([[0.5, 0.5, 0.0], [0.9, 0.5, 0.0]]), version=2)
    assert bytes_to_send(more, SHARE) == NODE_BYTES
    # Cells -5 to 14 of ten rows lie in two blocks of 64 each.
    whole = 2 * BOX_BYTES + 2 * NODE_BYTES + 20 * GROUND_BLOCK_BYTES
    assert bytes_to_send(SHARE, None) == whole
    assert bytes_to_send(SHARE, replace(nothing, version=0)) == whole


def block(x, y, width, depth):
    return Solid(np.array([[x, y], [x + width, y], [x + width, y + depth], [x, y + depth]]), 0.0, 2.0)


# Each robot looks at a corner that the others do not see.
STARTS = np.array([[1.0, 1.5, math.pi], [3.5, 1.5, math.pi / 2], [6.0, 1.5, 0.0]])
ROW = Floor("row", (0.0, 0.0, 7.0, 3.0), (block(0.0, 2.4, 0.3, 0.6), block(6.7, 0.0, 0.3, 0.6)), starts=STARTS)
CAMERA = {"columns": 80, "rows": 60, "pitch": 0.35}


def made(robots=3, **options):
    env = lidarium.parallel_env(
        ROW,
        level="waypoint",
        **{
            "robots": robots,
            "camera": CAMERA,
            "observe": ("pose", "depth"),
            "stop_coverage": None,
            "map_cells": 32,
            "resolution": 0.1,
            "decision_period_s": 1.0,
            "starts": "fixed",
            **options,
        },
    )
    env.reset(seed=0)
    for agent in env.agents:
        _ = env.belief(agent).shared_sparse_map
    return env


def waited(env, seconds):
    for _ in range(seconds):
        env.step(dict.fromkeys(env.agents))
    return env


def boxes_of(env, robot, shares_map=True):
    """Return the middles of the boxes on a robot's map, in the frame of the floor."""
    belief = env.perception.sparse_maps.belief(robot, shares_map)
    boxes = belief.navigation.index.boxes.reshape(-1, 2, 3)
    return (floor_from(env, robot) @ belief.frame).apply(boxes.mean(axis=1)[:, :2])


def floor_from(env, robot):
    """Return how the map frame of a robot truly lies on the floor."""
    if env.settings.known_starts:
        return Transform(*env.perception.poses.offset(robot))
    return Transform(*env.world.starts[robot])


def knows(env, robot, x):
    """Whether a robot's shared map has boxes at the end of the row at x."""
    return bool((np.abs(boxes_of(env, robot)[:, 0] - x) < 0.5).any())


def reach(metres, **options):
    return lidarium.RadioSettings(kind="range", reach=metres, **options)


def test_robots_out_of_contact_do_not_know_each_others_boxes():
    env = waited(made(radio=reach(2.0)), 3)
    assert knows(env, 0, 0.0)
    assert knows(env, 2, 7.0)
    assert not knows(env, 0, 7.0)
    assert not knows(env, 2, 0.0)
    assert env.perception.exchanges[0].bytes_sent.tolist() == [0, 0, 0]
    for agent in env.agents:
        belief = env.belief(agent)
        assert belief.shared_sparse_map.seen_m2 == belief.sparse_map.seen_m2


def test_boxes_are_sent_over_links_once_and_relayed_a_link_in_a_period():
    env = made(radio=reach(3.0, period_s=1.0))
    assert not knows(env, 0, 7.0), "the maps were asked for after the exchange at the start"
    waited(env, 1)
    assert knows(env, 1, 0.0)
    assert knows(env, 1, 7.0)
    assert not knows(env, 0, 7.0), "robot 2 is two links away"
    waited(env, 1)
    assert knows(env, 0, 7.0)
    assert knows(env, 2, 0.0)
    wall = np.abs(boxes_of(env, 0)[:, 0] - 7.0) < 0.5
    true = np.abs(boxes_of(env, 2)[:, 0] - 7.0) < 0.5
    assert np.sort(boxes_of(env, 0)[wall], axis=0) == pytest.approx(np.sort(boxes_of(env, 2)[true], axis=0), abs=1e-9)


def test_the_bytes_of_sparse_maps_are_counted():
    sent = {}
    for is_asked in (False, True):
        env = made(radio=reach(3.0))
        if not is_asked:
            env.reset(seed=0)
        waited(env, 3)
        sent[is_asked] = env.perception.exchanges[0].bytes_sent.copy()
    share = env.perception.sparse_maps.share(0)
    # Nobody moves: each map is sent once over a link, that of robot 0 by itself and by robot 1.
    assert sent[True][0] - sent[False][0] == bytes_to_send(share, None)
    relayed = sum(bytes_to_send(env.perception.sparse_maps.share(robot), None) for robot in (0, 2))
    assert sent[True][1] - sent[False][1] == relayed + 2 * bytes_to_send(env.perception.sparse_maps.share(1), None)


def test_lost_messages_bring_no_boxes():
    env = waited(made(radio=reach(3.0, loss=0.999999)), 3)
    assert not knows(env, 1, 7.0)
    assert env.perception.exchanges[0].bytes_sent.min() > 0


def test_robots_with_unknown_starts_get_the_boxes_of_those_with_whom_their_maps_are_joined():
    plain = waited(made(robots=2, known_starts=False), 2)
    assert not knows(plain, 0, 3.5)
    env = made(robots=2, known_starts=False)
    told = lidarium.MergedMaps(env, lidarium.MergingSettings(known_starts=True))
    told.reset(seed=0)
    _ = env.belief("robot_0").shared_sparse_map
    for _ in range(3):
        told.step(dict.fromkeys(env.agents))
    for robot in range(2):
        of_other = boxes_of(env, 1 - robot, shares_map=False)
        gaps = np.hypot(*np.moveaxis(of_other[:, None] - boxes_of(env, robot)[None], -1, 0)).min(axis=1)
        # Boxes that are rotated are cut, so that middles move.
        assert np.median(gaps) < 0.05
        assert gaps.max() < 0.3


def test_a_supervised_sparse_team_shares_boxes_when_the_station_has_joined_its_maps():
    env = lidarium.parallel_env(
        "apartment",
        robots=2,
        camera=CAMERA,
        observe=("pose", "depth", "scan"),
        known_starts=False,
        resolution=0.1,
        horizon_s=45.0,
        stop_coverage=None,
        map_cells=32,
        starts="fixed",
    )
    joined_at, growth = [], []

    def look(env):
        maps = [env.belief(agent) for agent in ("robot_0", "robot_1")]
        growth.append(maps[0].shared_sparse_map.seen_m2 - maps[0].sparse_map.seen_m2)
        joined_at.append(any(join.is_used for join in policy.joins))

    policy = lidarium.policy("supervised", explorer="sparse_frontier")
    lidarium.run_episode(policy, env, seed=0, on_decision=look)
    assert any(joined_at), "the maps of the apartment are joined within 45 s"
    first = joined_at.index(True)
    assert max(growth[:first]) == 0.0
    assert growth[-1] > 5.0
    assert env.world.collisions.sum() == 0
    # All boxes on the shared map lie within 10 cm of boxes that a robot has drawn, at their true places.
    points = boxes_of(env, 0)
    gaps = []
    for robot in range(2):
        own = env.belief(f"robot_{robot}").sparse_map
        into = (floor_from(env, robot) @ own.frame).inverse()
        gaps.append(distances_to(own.navigation.index.boxes.reshape(-1, 2, 3), into.apply(points)))
    assert np.min(gaps, axis=0).max() < 0.1


def test_a_supervised_sparse_team_ends_when_its_cameras_have_seen_the_floor():
    env = lidarium.parallel_env(
        ROW,
        robots=2,
        camera=CAMERA,
        observe=("pose", "depth", "scan"),
        known_starts=False,
        reveals_starts=True,
        resolution=0.1,
        horizon_s=200.0,
        stop_coverage=None,
        map_cells=32,
        starts="fixed",
    )
    policy = lidarium.policy("supervised", explorer="sparse_frontier", trusts_starts=True)
    lidarium.run_episode(policy, env, seed=0)
    assert set(env.scorer.ended_because.values()) <= {"no_frontier", "frontier_unreachable"}
    assert env.belief("robot_0").shared_sparse_map.seen_m2 > 0.9 * (7.0 * 3.0 - 0.36)
