"""Robots drive along routes on their sparse maps, whatever names their goals."""

import numpy as np
import pytest

import lidarium
from lidarium.envs.faces.merged_maps import MergedMaps
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.faces.sparse_planning import SparsePlanning
from lidarium.envs.floors.floor import Floor, Solid
from lidarium.envs.onboard.radio.messages import DriveState, Order, OrderKind, Target
from lidarium.envs.settings.making import make_settings
from lidarium.evaluation.episodes.runner import run_episode


def block(x, y, width, depth, low=0.0, high=2.0):
    return Solid(np.array([[x, y], [x + width, y], [x + width, y + depth], [x, y + depth]]), low, high)


LOW_TABLE = Floor(
    "low table",
    (0.0, 0.0, 7.0, 4.0),
    (block(3.0, 1.2, 1.0, 1.6, 0.38, 0.42),),
    starts=np.array([[1.0, 2.0, 0.0]]),
)

CAMERA = {"columns": 80, "rows": 60, "pitch": 0.35}
"""A camera of few pixels, tilted down."""


def made(floor=LOW_TABLE, level="waypoint", **options):
    chosen = {
        "robots": 1,
        "camera": CAMERA,
        "resolution": 0.05,
        "stop_coverage": None,
        "map_cells": 64,
        **options,
    }
    return ExplorationEnv(floor, make_settings(**chosen), level=level)


def driven_to(env, target, decisions=40):
    env.reset(seed=0)
    for _ in range(decisions):
        outcome = env.step({"robot_0": target})
        info = outcome[4]["robot_0"]
        if info["drive"] is DriveState.ARRIVED:
            break
    return env, info


def test_robots_drive_round_what_only_the_camera_sees():
    target = Target(4.0, 0.0)
    plain, _ = driven_to(made(), target)
    sparse, info = driven_to(SparsePlanning(made()), target)
    assert plain.unwrapped.world.collisions[0] > 0, "the laser's plane passes below the table"
    assert sparse.unwrapped.world.collisions[0] == 0
    assert info["drive"] is DriveState.ARRIVED
    assert info["route"] == ""
    assert sparse.unwrapped.belief("robot_0").pose[:2] == pytest.approx([4.0, 0.0], abs=0.1)


def test_spaces_are_those_of_the_environment_below():
    below = made(level="frontier")
    env = SparsePlanning(below)
    assert env.observation_space("robot_0") is below.observation_space("robot_0")
    assert env.action_space("robot_0") is below.action_space("robot_0")
    assert env.metadata["name"] == "lidarium_frontier_exploration_sparse_v1"
    assert env.unwrapped is below.unwrapped


def test_chosen_frontiers_are_driven_to_along_sparse_routes():
    env = SparsePlanning(made("apartment", "frontier", horizon_s=30.0))
    observations, _ = env.reset(seed=0)
    followed = 0
    while env.agents:
        offered = np.flatnonzero(observations["robot_0"]["action_mask"][:-1])
        observations = env.step({"robot_0": int(offered[0]) if len(offered) else 16})[0]
        followed += env.unwrapped.driver.route_left(0) is not None
    assert followed > 10
    assert env.unwrapped.scorer.coverage > 0.4
    assert env.unwrapped.world.collisions.sum() == 0


def test_the_reason_is_said_where_there_is_no_route():
    shut = Floor(
        "shut",
        (0.0, 0.0, 7.0, 4.0),
        (block(3.0, -1.0, 0.3, 6.0), block(4.5, 1.0, 1.5, 1.5)),
        starts=np.array([[1.0, 2.0, 0.0]]),
    )
    env, info = driven_to(SparsePlanning(made(shut)), Target(5.0, 1.5), 60)
    assert info["route"] == "no path"
    assert info["drive"] is DriveState.NO_PATH
    assert driven_to(SparsePlanning(made()), Target(2.6, 0.1), 20)[1]["route"] == "goal in collision"
    env, info = driven_to(SparsePlanning(made()), Target(2.1, 0.0), 20)
    assert info["route"] == "", "a goal beside the edge is approached as near as the body can stand"
    assert env.unwrapped.world.poses[0, 0] == pytest.approx(2.7, abs=0.2)
    assert env.unwrapped.world.collisions[0] == 0


def test_orders_of_a_station_are_driven_along_routes_too():
    env = SparsePlanning(made())
    env.reset(seed=0)
    env.order("robot_0", Order(OrderKind.GO_TO, Target(0.6, 0.6)))
    for _ in range(6):
        env.step({})
    assert env.unwrapped.driver.route_left(0) is not None
    assert env.unwrapped.belief("robot_0").pose[:2] == pytest.approx([0.6, 0.6], abs=0.1)


def test_robots_without_cameras_or_without_goals_are_refused():
    with pytest.raises(ValueError, match=r"no depth camera.*camera='xtion'"):
        SparsePlanning(made(camera=None))
    env = lidarium.parallel_env(
        "apartment", robots=1, camera="xtion_tilted", observe=["scan", "pose", "bumper"], starts="fixed"
    )
    with pytest.raises(ValueError, match="the policy decides speeds; want waypoints or frontiers"):
        run_episode(lidarium.policy("random_walk"), env, 0, plans_sparsely=True)


def test_a_goal_far_beyond_the_map_has_no_path():
    _, info = driven_to(SparsePlanning(made(horizon_s=None)), Target(1000.0, 1000.0), 14)
    assert (info["route"], info["drive"]) == ("no path", DriveState.NO_PATH)


def test_another_level_plans_sparsely_too():
    env = SparsePlanning(made("apartment", horizon_s=10.0))
    env.use_level("frontier")
    fresh = SparsePlanning(made("apartment", "frontier", horizon_s=10.0))
    for each in (env, fresh):
        each.reset(seed=0)
        while each.agents:
            each.step({"robot_0": 0})
    assert env.unwrapped.world.poses.tolist() == fresh.unwrapped.world.poses.tolist()
    assert env.unwrapped.engine.level.router is not None
    with pytest.raises(ValueError, match="around the level 'velocity'; want waypoints or frontiers"):
        env.use_level("velocity")
    assert env.unwrapped.engine.level_name == "frontier"


@pytest.mark.parametrize("infos", ["flat", "none"])
def test_reasons_are_told_in_full_infos_alone(infos):
    below = lidarium.parallel_env(
        "apartment", level="waypoint", robots=1, camera=CAMERA, resolution=0.05, infos=infos, map_cells=64
    )
    assert "route" not in SparsePlanning(below).reset(seed=0)[1].get("robot_0", {})


def test_options_that_are_not_true_or_false_are_refused():
    for name in ("plans_sparsely", "shares_map"):
        with pytest.raises(ValueError, match=f"{name} is 'no'; want True or False"):
            lidarium.vector_env(1, "apartment", level="waypoint", camera=CAMERA, **{name: "no"})


def test_maps_may_be_merged_above_it():
    env = MergedMaps(SparsePlanning(made("apartment", robots=2, horizon_s=4.0)))
    observations, _ = env.reset(seed=0)
    assert "team_map" in observations["robot_0"]
    env.step(dict.fromkeys(env.agents))


@pytest.mark.parametrize("backend", ["kinematic", "bullet"])
def test_a_policy_of_the_laser_explores_along_sparse_routes(backend):
    if backend == "bullet":
        pytest.importorskip("pybullet")
    env = lidarium.parallel_env(
        "open_apartment",
        robots=2,
        camera=CAMERA,
        backend=backend,
        resolution=0.05,
        horizon_s=25.0,
        map_cells=32,
        starts="fixed",
    )
    run_episode(lidarium.policy("nearest_frontier"), env, seed=0, plans_sparsely=True)
    assert env.scorer.coverage > 0.7
    assert env.world.collisions.sum() == 0
    env.close()


def test_a_batch_drives_along_the_routes_of_single_environments():
    options = {"robots": 1, "camera": CAMERA, "resolution": 0.05, "stop_coverage": None, "map_cells": 64}
    batch = lidarium.vector_env(2, LOW_TABLE, level="waypoint", plans_sparsely=True, **{"starts": "fixed", **options})
    single = SparsePlanning(made())
    batch.reset(seed=0)
    single.reset(seed=0)
    target = Target(4.0, 0.0)
    for _ in range(12):
        _, _, _, _, wanted = single.step({"robot_0": target})
        _, _, _, _, infos = batch.step([{"robot_0": target}, {"robot_0": Target(1.0, 0.0)}])
        assert infos["route"][0] == wanted["robot_0"]["route"]
        assert infos["_route"].all()
    assert np.array_equal(batch.engine.world.poses[0], single.unwrapped.world.poses[0])
    assert batch.engine.world.collisions[0] == 0
    with pytest.raises(ValueError, match="SparsePlanning is put around the level 'velocity'"):
        lidarium.vector_env(1, LOW_TABLE, plans_sparsely=True, **options)


def test_routes_are_planned_on_the_maps_of_settings_newly_drawn():
    options = {"robots": 1, "camera": CAMERA, "resolution": 0.05, "stop_coverage": None, "map_cells": 64}
    drawn = {**options, "level": "waypoint", "starts": "fixed", "randomize": {"reward.time": (0.0, 1.0)}}
    single = SparsePlanning(lidarium.parallel_env(LOW_TABLE, **drawn))
    batch = lidarium.vector_env(1, LOW_TABLE, plans_sparsely=True, **drawn)
    for seed in (0, 1):
        single.reset(seed=seed)
        batch.reset(seed=seed)
        for target in [Target(4.0, 0.0)] * 12 + [Target(2.5, 0.0)]:  # the last one lies in the table
            _, _, _, _, wanted = single.step({"robot_0": target})
            _, _, _, _, infos = batch.step([{"robot_0": target}])
            assert infos["route"][0] == wanted["robot_0"]["route"]
        assert np.array_equal(batch.batch.parts[0].engine.world.poses, single.unwrapped.world.poses)
        assert single.unwrapped.world.collisions[0] == 0


def test_robots_of_a_batch_may_plan_on_their_own_maps_alone():
    options = {"robots": 2, "camera": CAMERA, "resolution": 0.05, "map_cells": 64, "starts": "fixed"}
    batch = lidarium.vector_env(1, "open_apartment", level="frontier", plans_sparsely=True, shares_map=False, **options)
    single = lidarium.parallel_env("open_apartment", level="frontier", **options)
    single.use_level("frontier", shares_map=False)
    single = SparsePlanning(single, shares_map=False)
    observations, _ = single.reset(seed=0)
    rows, _ = batch.reset(seed=0)
    for _ in range(6):
        actions = {agent: int(np.flatnonzero(observations[agent]["action_mask"])[0]) for agent in single.agents}
        observations, *_ = single.step(actions)
        rows, *_ = batch.step([actions])
        for robot, agent in enumerate(single.agents):
            np.testing.assert_array_equal(rows["frontiers"][robot], observations[agent]["frontiers"])
    assert np.array_equal(batch.engine.world.poses, single.unwrapped.world.poses)
