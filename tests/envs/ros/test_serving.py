"""A served team is robots of ROS 2: what it publishes is the simulation, and it takes commands as bases do."""

import math

import numpy as np
import pytest

pytest.importorskip("cyclonedds", reason="cyclonedds (extra ros) is not installed")

from ros_graphs import heard, node, until

import lidarium
from lidarium.envs.ros.serving import BEGINNING_S, TeamServer
from lidarium.envs.settings.faults import Fault, FaultSettings
from lidarium.mapping.files.bags.messages import (
    CLOCK,
    GRID,
    LASER_SCAN,
    ODOMETRY,
    POSE_STAMPED,
    TRANSFORMS,
    TWIST,
    TWIST_STAMPED,
)
from lidarium.mapping.files.bags.reading import in_plane


def environment(robots=1, **options):
    env = lidarium.ExplorationEnv(
        "apartment",
        lidarium.make_settings(
            robots=robots, horizon_s=None, stop_coverage=None, observe=("velocity",), starts="fixed", **options
        ),
    )
    env.reset(seed=0)
    return env


@pytest.fixture
def nodes():
    with node("robots") as robots, node("driver") as driver:
        yield robots, driver


def run(server, steps):
    end = server.counts.steps + steps
    server.run(0.0, is_over=lambda: server.counts.steps >= end)


def planar(transform):
    return in_plane(transform.translation, transform.rotation)


def test_scans_odometry_and_clock_are_those_of_the_simulation(nodes):
    robots, driver = nodes
    for topic, name in (("/robot_0/scan", LASER_SCAN), ("/robot_0/odom", ODOMETRY), ("/clock", CLOCK)):
        driver.subscribe(topic, name)
    env = environment()
    server = TeamServer(env, robots)
    until(
        lambda: (
            robots.subscribers("/robot_0/scan") and robots.subscribers("/robot_0/odom") and robots.subscribers("/clock")
        )
    )
    run(server, 1)
    scan, odometry = heard(driver, "/robot_0/scan", 2)[-1], heard(driver, "/robot_0/odom", 2)[-1]
    np.testing.assert_array_equal(scan.ranges, env.simulation.ranges[0])
    assert scan.header.frame_id == "robot_0/laser"
    assert scan.header.stamp.sec + 1e-9 * scan.header.stamp.nanosec == pytest.approx(BEGINNING_S + 0.1)
    assert (odometry.header.frame_id, odometry.child_frame_id) == ("robot_0/odom", "robot_0/base_link")
    assert heard(driver, "/clock")[-1].clock.sec == 1


@pytest.mark.parametrize(("shows_truth", "topics"), [(True, ("/tf", "/map")), (False, ("/truth/tf", "/truth/map"))])
def test_the_truth_is_shown_or_put_aside(nodes, shows_truth, topics):
    robots, driver = nodes
    driver.subscribe(topics[0], TRANSFORMS)
    driver.subscribe(topics[1], GRID)
    env = environment()
    server = TeamServer(env, robots, shows_truth)
    robots.advertise(topics[0], TRANSFORMS)
    until(lambda: robots.subscribers(topics[0]))
    run(server, 1)
    chain = {
        (each.header.frame_id, each.child_frame_id): planar(each.transform)
        for message in heard(driver, topics[0], 2)
        for each in message.transforms
    }
    x, y, theta = chain["map", "robot_0/odom"]  # the start, since these wheels do not err
    np.testing.assert_allclose((x, y, theta), env.world.starts[0], atol=1e-9)
    grid = heard(driver, topics[1])[0]
    tables = env.world.floors[0]
    np.testing.assert_array_equal(grid.data.reshape(grid.info.height, -1) == 100, tables.laser.solid != 0)


@pytest.mark.parametrize(("name", "frame"), [(TWIST, None), (TWIST_STAMPED, "robot_0/base_link")])
def test_a_robot_drives_as_commanded_and_stops_when_commands_do(nodes, name, frame):
    robots, driver = nodes
    env = environment()
    server = TeamServer(env, robots)
    driver.advertise("/robot_0/cmd_vel", name)
    until(lambda: driver.subscribers("/robot_0/cmd_vel"))
    driver.velocity("/robot_0/cmd_vel", frame, 0.0, (0.2, 0.5))
    until(lambda: robots.wait(0.1))
    run(server, 4)
    np.testing.assert_allclose(env.world.velocities[0], [0.2, 0.5])
    run(server, 20)
    np.testing.assert_allclose(env.world.velocities[0], [0.0, 0.0])


def test_the_onboard_driver_takes_a_robot_to_a_goal(nodes):
    robots, driver = nodes
    env = environment()
    server = TeamServer(env, robots)
    driver.advertise("/robot_0/goal_pose", POSE_STAMPED)
    until(lambda: driver.subscribers("/robot_0/goal_pose"))
    x, y, theta = env.world.poses[0]
    goal = x + 0.8 * math.cos(theta), y + 0.8 * math.sin(theta), theta
    driver.goal("/robot_0/goal_pose", "map", 0.0, goal)
    until(lambda: robots.wait(0.1))
    run(server, 150)
    assert math.dist(env.world.poses[0, :2], goal[:2]) < 0.2


def test_bad_commands_and_those_of_a_second_driver_are_refused_and_counted(nodes):
    robots, driver = nodes
    server = TeamServer(environment(), robots)
    with node("rival") as rival:
        for each, name in ((driver, TWIST), (rival, TWIST_STAMPED)):
            each.advertise("/robot_0/cmd_vel", name)
            until(lambda each=each: each.subscribers("/robot_0/cmd_vel"))
        driver.advertise("/robot_0/goal_pose", POSE_STAMPED)
        until(lambda: driver.subscribers("/robot_0/goal_pose"))
        driver.velocity("/robot_0/cmd_vel", None, 0.0, (math.nan, 0.0))
        driver.velocity("/robot_0/cmd_vel", None, 0.0, (0.1, 0.0))
        until(lambda: server._hear() or server.counts.commands == 1)
        rival.velocity("/robot_0/cmd_vel", "robot_0/base_link", 0.0, (-0.5, 0.0))
        driver.goal("/robot_0/goal_pose", "nowhere", 0.0, (0.0, 0.0, 0.0))
        until(lambda: server._hear() or len(robots.refused) == 3)
    assert robots.refused == {
        "/robot_0/cmd_vel: nan or infinite": 1,
        "/robot_0/cmd_vel: from a second driver": 1,
        "/robot_0/goal_pose: not a pose in frame map": 1,
    }
    assert server._driven[0].velocity == (0.1, 0.0)


def test_an_interrupted_run_is_counted_as_well(nodes):
    server = TeamServer(environment(), nodes[0])

    def is_over():
        if server.counts.steps == 3:
            raise KeyboardInterrupt
        return False

    with pytest.raises(KeyboardInterrupt):
        server.run(0.0, is_over=is_over)
    assert server.counts.wall_s > 0.0
    assert server.counts.cpu_s > 0.0


def test_serving_ends_with_the_last_robot(nodes):
    env = environment(faults=FaultSettings(schedule=[Fault(kind="dead_robot", at_s=0.5)]))
    server = TeamServer(env, nodes[0])
    run(server, 20)
    assert server.counts.steps < 10
    assert env.scorer.ended_because == {"robot_0": "failed"}
