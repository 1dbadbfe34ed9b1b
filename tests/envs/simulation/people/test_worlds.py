"""Depth cameras see people and doors, and in PyBullet they are bodies."""

import numpy as np
import pytest
from doored_rooms import robot_at_door

from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.floors.floor import Floor
from lidarium.envs.settings.faults import Fault, FaultSettings
from lidarium.envs.settings.making import make_settings
from lidarium.envs.simulation.kernels.arrays import (
    BY_ROBOT,
    DOOR_END_X,
    DOOR_END_Y,
    DOOR_KIND,
    DOOR_OPEN,
    DOOR_X,
    DOOR_Y,
    MAP_RESOLUTION,
    OPENS,
    PERSON_BEAM,
    PERSON_GAP,
    RANGE_MAX,
    STAYS_SHUT,
    WALKER_RADIUS,
    WALKER_VX,
    WALKER_VY,
    WALKER_WAIT,
    WALKER_X,
    WALKER_Y,
    world_at,
)
from lidarium.envs.simulation.kernels.masks import footprint
from lidarium.envs.simulation.people.crowd import crowd_of
from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.grids.scan_polygon import window_rows, window_words
from lidarium.mapping.kernels.compilation import kernel

HALL = Floor("hall", (0.0, 0.0, 8.0, 6.0))
START = {"starts": [(2.0, 3.0, 0.0)]}


def begun(**options):
    env = ExplorationEnv(HALL, make_settings(**{"robots": 1, "horizon_s": None, "resolution": 0.05, **options}))
    env.reset(seed=0, options=START)
    return env


def test_a_depth_camera_sees_a_person_at_his_distance():
    env = begun(people=1, camera="xtion", noise="none")
    walker, camera = env.simulation.population.people_of(0)[0], env.settings.camera
    depths = []
    for x in (1.0, 3.5):  # behind the robot, and ahead of it
        walker[WALKER_X], walker[WALKER_Y] = x, 3.0
        env.simulation.camera.take(np.zeros(1, np.int64) - 1)
        depths.append(float(env.simulation.camera.frames[0, 10, camera.columns // 2]))
    expected = 1.5 - walker[WALKER_RADIUS] - camera.forward
    assert depths[1] == pytest.approx(expected, abs=0.15)
    assert depths[0] == 0.0 or depths[0] > 3.0


def test_a_depth_camera_sees_a_leaf():
    env, door = robot_at_door(STAYS_SHUT, camera="xtion")
    depths = []
    for share in (0.0, 1.0):
        door[DOOR_OPEN] = share
        env.simulation.camera.take(np.zeros(1, np.int64) - 1)
        depths.append(float(env.simulation.camera.frames[0, 10, env.settings.camera.columns // 2]))
    assert depths[0] == pytest.approx(3.0 - env.settings.camera.forward, abs=0.2)
    assert depths[1] == 0.0 or depths[1] > depths[0] + 1.0


def boxes_within(env, low, high):
    """Return the number of boxes of the robot's sparse map in a part of the floor."""
    share = env.perception.sparse_maps.share(0)
    middles = Transform(theta=share.axes).apply(share.boxes.mean(axis=1)[:, :2])
    return int(np.all((middles > low) & (middles < high), axis=1).sum())


def test_people_stay_out_of_sparse_maps():
    env = begun(people=1, camera="xtion", observe=("depth",))
    walker = env.simulation.population.people_of(0)[0]
    walker[[WALKER_X, WALKER_Y, WALKER_WAIT]] = 3.5, 3.0, 1e6
    env.perception.sparse_maps.of(0)
    for turn in (1.0,) * 6 + (-1.0,) * 6:
        env.step({"robot_0": [0.0, turn]})
    assert boxes_within(env, (2.8, 2.3), (4.2, 3.7)) == 0


@pytest.mark.parametrize(("kind", "is_mapped"), [(OPENS, False), (STAYS_SHUT, True)])
def test_leaves_of_doors_that_open_stay_out_of_sparse_maps(kind, is_mapped):
    env, door = robot_at_door(kind, camera="xtion", observe=("depth",))
    env.perception.sparse_maps.of(0)
    for turn in (1.0,) * 6 + (-1.0,) * 6:
        env.step({"robot_0": [0.0, turn]})
        door[DOOR_OPEN] = 0.0
    ends = door[[DOOR_X, DOOR_Y, DOOR_END_X, DOOR_END_Y]].reshape(2, 2)
    # The jambs beside the leaf are walls.
    inside = np.array([-0.15, 0.2])
    low, high = ends.min(axis=0) + inside, ends.max(axis=0) - inside
    assert (boxes_within(env, low, high) > 0) == is_mapped


def test_in_pybullet_a_robot_that_drives_into_a_person_touches_him():
    pytest.importorskip("pybullet", reason="the extra bullet is not installed")
    env = begun(people=1, backend="bullet")
    walker = env.simulation.population.people_of(0)[0]
    gaps = []
    for _ in range(40):
        # He stands in the way, whatever he would do.
        walker[WALKER_X], walker[WALKER_Y], walker[WALKER_WAIT] = 3.0, 3.0, 1e6
        env.world.bodies_of(0).move_crowd(crowd_of(env.simulation.population))
        env.step({"robot_0": np.array([0.6, 0.0], np.float32)})
        apart = np.hypot(*(walker[[WALKER_X, WALKER_Y]] - env.world.poses[0, :2]))
        gaps.append(apart - 0.18 - walker[WALKER_RADIUS])
    assert min(gaps) == pytest.approx(0.0, abs=0.02)
    assert env.simulation.safety[0, BY_ROBOT] >= 1.0
    env.close()


def test_in_pybullet_a_shut_door_stops_a_robot():
    pytest.importorskip("pybullet", reason="the extra bullet is not installed")
    env, door = robot_at_door(STAYS_SHUT, backend="bullet")
    assert door[DOOR_KIND] == STAYS_SHUT
    for _ in range(120):
        env.step({"robot_0": np.array([0.5, 0.0], np.float32)})
    leaf = 0.5 * (door[[DOOR_X, DOOR_Y]] + door[[DOOR_END_X, DOOR_END_Y]])
    assert env.world.poses[0, 0] < leaf[0] - 0.15
    env.close()


@pytest.mark.parametrize("hidden_by", ["a door", "a dropout", "its height", None])
def test_robots_recognise_only_people_of_whom_their_laser_sees_a_part(hidden_by):
    dropout = FaultSettings(schedule=(Fault(kind="laser_dropout", at_s=0.0),))
    options = {
        "a dropout": {"faults": dropout},
        "its height": {"robot": {"height": 2.2}, "lidar": {"height": 1.9}},
    }
    env, door = robot_at_door(STAYS_SHUT, people=1, **options.get(hidden_by, {}))
    door[DOOR_OPEN] = 0.0 if hidden_by == "a door" else 1.0
    population = env.simulation.population
    walker = population.people_of(0)[0]
    walker[[WALKER_X, WALKER_Y, WALKER_VX, WALKER_VY, WALKER_WAIT]] = 4.5, 1.95, 0.0, 0.0, 1000.0
    env.step({"robot_0": np.zeros(2, np.float32)})
    gap = 3.5 - walker[WALKER_RADIUS] - env.settings.robot.radius
    assert population.safety[0, PERSON_GAP] == (pytest.approx(gap) if hidden_by is None else np.inf)
    assert (population.recognised[0] == PERSON_BEAM).any() == (hidden_by is None)


def test_looking_where_a_robot_would_see_does_not_change_whom_it_has_seen():
    env = begun(people=3, scan_period_s=0.4, noise="datasheet")
    population, sensor = env.simulation.population, env.simulation.sensor[0]
    reach = sensor[RANGE_MAX] / sensor[MAP_RESOLUTION]
    for _ in range(10):
        env.step({"robot_0": np.array([0.3, 0.5], np.float32)})
        before = population.recognised.copy(), population.safety.copy()
        look(env.simulation.table, np.zeros((window_rows(reach), window_words(reach)), np.uint64))
        assert np.array_equal(population.recognised, before[0])
        assert np.array_equal(population.safety, before[1])
    assert before[0].any()


@kernel
def look(table, bits):
    footprint(world_at(table), 0, 0, 1, bits)
