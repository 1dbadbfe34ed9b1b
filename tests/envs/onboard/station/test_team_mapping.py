"""Robots that talk hold each other's maps, and what these come to together."""

import math

import numpy as np
import pytest

import lidarium
from lidarium.envs.floors.floor import Floor, Solid
from lidarium.envs.onboard.station.reports import known_map
from lidarium.envs.onboard.station.team_mapping import TeamMapping, crop_around
from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.grids.occupancy import FREE, OCCUPIED, UNKNOWN
from lidarium.mapping.merging.fusion import FusedMap

STARTS = np.array([[2.4, 4.0, 0.0], [3.3, 4.5, 1.2], [1.5, 3.0, -2.0]])
WALL = Solid(np.array([[3.9, 0.0], [4.1, 0.0], [4.1, 3.0], [3.9, 3.0]]))
HALL = Floor("hall", (0.0, 0.0, 6.0, 6.0), (WALL,))
ALL = ["robot_0", "robot_1", "robot_2"]


def team(floor=HALL, robots=3, turns=0, **options):
    """Robots that do not know where the others start, and how their frames truly lie."""
    env = lidarium.parallel_env(
        floor, robots=robots, known_starts=False, map_cells=32, **{"resolution": 0.05, **options}
    )
    env.reset(seed=0, options={"starts": STARTS[:robots]})
    for _ in range(turns):
        env.step({agent: [0.0, 0.8] for agent in env.agents})
    frames = [Transform(*start) for start in STARTS]
    pairs = [(i, j) for i in range(robots) for j in range(robots) if i != j]
    return env, {(f"robot_{i}", f"robot_{j}"): frames[i].inverse() @ frames[j] for i, j in pairs}


def test_robots_that_reach_each_other_get_maps_and_poses():
    env, frames = team()
    mapping = TeamMapping(env.perception)
    joined = mapping.exchange([["robot_0", "robot_1"], ["robot_2"]], 3.0, frames)
    assert set(joined) == {("robot_0", "robot_1")}
    found, at, is_direct = joined["robot_0", "robot_1"]
    assert found == frames["robot_0", "robot_1"]
    assert at == pytest.approx((0.0, 0.0))
    assert is_direct
    assert set(mapping.received) == {("robot_0", "robot_1"), ("robot_1", "robot_0")}
    received = mapping.received["robot_1", "robot_0"]
    assert received.time_s == 3.0
    assert np.array_equal(received.map.levels, known_map(env.perception, 0).levels)
    gap = received.own_from_other @ frames["robot_0", "robot_1"]
    assert (gap.x, gap.y, gap.theta) == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)


def test_a_fused_map_holds_what_its_robot_knows_and_has_got():
    env, frames = team()
    mapping = TeamMapping(env.perception)
    mapping.exchange([[agent] for agent in ALL], 0.0, frames)
    alone = {agent: np.count_nonzero(mapping.fused[agent].levels != UNKNOWN) for agent in ALL}
    for row, agent in enumerate(ALL):
        assert alone[agent] == np.count_nonzero(known_map(env.perception, row).levels != UNKNOWN)
    mapping.exchange([["robot_0", "robot_1"], ["robot_2"]], 1.0, frames)
    together = {agent: np.count_nonzero(mapping.fused[agent].levels != UNKNOWN) for agent in ALL}
    assert together["robot_0"] > alone["robot_0"]
    assert together["robot_1"] > alone["robot_1"]
    assert together["robot_2"] == alone["robot_2"]


def test_what_was_got_is_remembered_until_the_episode_ends():
    env, frames = team()
    mapping = TeamMapping(env.perception)
    mapping.exchange([ALL], 0.0, frames)
    assert mapping.exchange([[agent] for agent in ALL], 1.0, frames) == {}
    assert len(mapping.received) == 6
    assert all(received.time_s == 0.0 for received in mapping.received.values())
    mapping.start()
    assert mapping.received == mapping.fused == {}


def test_frames_are_found_by_what_maps_show():
    env, frames = team("apartment", 2, turns=15, resolution=0.025)
    mapping = TeamMapping(env.perception, confirms=False)
    joined = mapping.exchange([["robot_0", "robot_1"]], 1.5)
    true = frames["robot_0", "robot_1"]
    found = joined["robot_0", "robot_1"]
    assert math.hypot(found.a_from_b.x - true.x, found.a_from_b.y - true.y) < 0.1
    assert math.remainder(found.a_from_b.theta - true.theta, math.tau) == pytest.approx(0.0, abs=0.05)
    assert found.is_direct
    # Who has to be sure is not joined by one finding.
    assert TeamMapping(env.perception).exchange([["robot_0", "robot_1"]], 1.5) == {}


def fused_map():
    levels = np.full((4, 6), FREE, np.uint8)
    levels[0], levels[3, 5] = OCCUPIED, UNKNOWN
    return FusedMap(
        levels, np.zeros((4, 6), np.float32), np.zeros((4, 6), np.uint64), origin=(1.0, -0.5), resolution=0.5
    )


def test_a_crop_is_cells_around_a_place_and_unknown_outside_of_the_map():
    fused = fused_map()
    # The place lies in row 1, column 2.
    crop = crop_around(fused, 2.2, 0.1, 4)
    assert crop.shape == (4, 4)
    assert (crop[0] == UNKNOWN).all()
    assert np.array_equal(crop[1:], fused.levels[:3, :4])
    assert np.array_equal(crop_around(fused, 2.0, 0.0, 2), fused.levels[:2, 1:3])
    whole = crop_around(fused, 2.5, 0.5, 20)
    assert np.count_nonzero(whole != UNKNOWN) == np.count_nonzero(fused.levels != UNKNOWN)


@pytest.mark.parametrize("place", [(50.0, 0.0), (-50.0, 0.0), (2.0, 70.0), (2.0, -70.0)])
def test_a_crop_far_from_the_map_knows_nothing(place):
    assert (crop_around(fused_map(), *place, 6) == UNKNOWN).all()
