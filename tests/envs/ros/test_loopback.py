"""Both ends against each other: a policy drives served robots over DDS, and a bag is played to a listener."""

import json
import threading
from contextlib import contextmanager

import numpy as np
import pytest

pytest.importorskip("cyclonedds", reason="cyclonedds (extra ros) is not installed")

from ros_graphs import DOMAIN, node, until

import lidarium
from lidarium.envs.ros import robots
from lidarium.envs.ros.playing import play
from lidarium.envs.ros.robots import RobotLink, Transforms, names_of
from lidarium.envs.ros.serving import TeamServer
from lidarium.mapping.files.bags.messages import GRID
from lidarium.mapping.localization.localizer import Sensing
from lidarium.mapping.localization.slam.following import follow
from lidarium.scripts.main import main

DRIVE = ("ros", "drive", "--domain", str(DOMAIN), "--localhost", "--timeout-s", "60", "--json")


@contextmanager
def served(robots, *, waits=True, speed=0.0):
    """Serve a team in a thread as long as it is driven."""
    settings = lidarium.make_settings(
        robots=robots, horizon_s=None, stop_coverage=None, observe=("velocity",), starts="fixed"
    )
    env = lidarium.ExplorationEnv("apartment", settings)
    env.reset(seed=0)
    over = threading.Event()
    with node("robots") as graph:
        server = TeamServer(env, graph)
        thread = threading.Thread(target=server.run, args=(speed,), kwargs={"waits": waits, "is_over": over.is_set})
        thread.start()
        try:
            yield server
        finally:
            over.set()
            thread.join(150.0)
            assert not thread.is_alive()


def drive(out, *options):
    code = main([*DRIVE, "--out", str(out), *options])
    return code, json.loads((out / "result.json").read_text())


def test_a_driven_robot_goes_where_it_goes_without_ros(tmp_path, capsys):
    with served(1) as server:
        code, result = drive(tmp_path, "--horizon-s", "12", "--stale-s", "60")
    settings = lidarium.make_settings(
        robots=1,
        horizon_s=12.0,
        stop_coverage=None,
        known_starts=False,
        localization="slam",
        resolution=0.05,
        starts="fixed",
    )
    direct = lidarium.ExplorationEnv("apartment", settings)
    lidarium.run_episode(lidarium.policy("nearest_frontier"), direct, seed=0)
    assert (code, result["ended_because"], result["stale_steps"]) == (0, {"robot_0": "horizon"}, 0)
    assert server.counts.steps in (120, 121)  # the last command stops the robot
    assert result["travelled_m"]["robot_0"] > 1.0
    np.testing.assert_allclose(server.env.world.poses[0, :2], direct.world.poses[0, :2], atol=0.3)
    assert (tmp_path / "robot_0.pgm").stat().st_size > 1000


def test_robots_are_driven_by_goals_in_the_frame_of_the_transforms(tmp_path, capsys):
    options = ("--horizon-s", "12", "--localization", "tf", "--sends", "goals", "--stale-s", "5")
    with served(1, waits=False, speed=4.0) as server:
        code, result = drive(tmp_path, *options)
        corner = server.env.perception.poses.offset(0)

        def is_there():
            """Whether the robot is at its last goal; the end of the drive may have set another one."""
            goal = server._driven[0].target
            return goal and np.hypot(*(server.env.world.poses[0, :2] - corner - (goal.x, goal.y))) < 0.2

        until(is_there)  # it stops there
    assert code == 0
    assert result["travelled_m"]["robot_0"] > 0.5
    assert not server.graph.refused


def test_a_robot_that_is_given_the_map_has_nothing_to_explore(tmp_path, capsys, monkeypatch):
    begin = robots.begin_driving
    monkeypatch.setattr(robots, "begin_driving", lambda graph, topics: begin(graph, topics) or list(topics))
    with served(1) as server:
        code, result = drive(tmp_path, "--horizon-s", "60", "--localization", "tf", "--map", "--stale-s", "60")
    assert "nobody reads /robot_0/cmd_vel as Twist yet: want a robot that does, or --stamped" in capsys.readouterr().err
    assert code == 0
    assert result["free_m2"]["robot_0"] > 40.0
    assert result["travelled_m"]["robot_0"] < 1.0
    assert result["ended_because"]["robot_0"] != "horizon"
    assert server.counts.steps < 100


def test_a_team_goes_on_without_a_robot_that_falls_silent(tmp_path, capsys, monkeypatch):
    with served(2) as server:
        send = server.graph.scan

        def scan(topic, *arguments, **options):
            if topic != "/robot_1/scan" or server.counts.steps < 30:
                send(topic, *arguments, **options)

        monkeypatch.setattr(server.graph, "scan", scan)
        code, result = drive(
            tmp_path, "--horizon-s", "10", "--stale-s", "4", "--lost-s", "3",
            "--namespaces", "robot_0", "robot_1", "--policy", "nearest_frontier",
        )  # fmt: skip
        assert server._driven[1].velocity == (0.0, 0.0)
    assert code == 4
    assert result["ended_because"] == {"robot_0": "horizon", "robot_1": "failed"}
    assert result["remarks"] == ["robot_1 fell silent and was given up"]
    assert result["stale_steps"] > 0


def test_a_merged_map_is_published(tmp_path, capsys):
    heard = []
    with served(2), node("listener") as listener:
        listener.subscribe("/merged_map", GRID)
        code, _ = drive(tmp_path, "--horizon-s", "4", "--stale-s", "60", "--localization", "tf",
                        "--namespaces", "robot_0", "robot_1")  # fmt: skip
        heard += [each.message for each in listener.take("/merged_map")]
    assert code == 0
    assert heard[-1].header.frame_id == "map"
    assert (heard[-1].data == 0).sum() * 0.05**2 > 10.0


def test_a_driver_in_another_domain_finds_nobody(tmp_path, capsys):
    code = main(
        ["ros", "drive", "--domain", str(DOMAIN + 1), "--localhost", "--timeout-s", "0.3", "--out", str(tmp_path)]
    )
    assert code == 2
    assert f"in domain {DOMAIN + 1} nothing usable came on /robot_0/scan" in capsys.readouterr().err


@pytest.fixture(scope="module")
def bag(tmp_path_factory):
    """A bag of a robot that explores."""
    from lidarium.evaluation.record import Recorder
    from lidarium.evaluation.record.bag import write_bag

    recorder = Recorder("nearest_frontier", 0, "apartment")
    from lidarium.evaluation.episodes.watching import WatchedExploration

    settings = lidarium.make_settings(
        robots=1, horizon_s=8.0, noise="datasheet", odometry="typical", localization="slam"
    )
    env = WatchedExploration("apartment", settings, watchers=[recorder])
    lidarium.run_episode(lidarium.policy("nearest_frontier"), env, seed=0)
    path = tmp_path_factory.mktemp("bag") / "run.mcap"
    write_bag(path, recorder.finish())
    return path


def test_slam_on_a_played_bag_is_slam_on_the_bag(bag):
    log = lidarium.read_log(bag)
    readings = []
    with node("player") as player, node("driver") as driver:
        link = RobotLink(driver, names_of("robot_0"), Transforms(driver))

        def listen():
            before = len(readings)
            until(lambda: link.geometry is not None or link.begin())
            until(lambda: readings.extend(link.readings(10.0)) or len(readings) > before)

        play(bag, player, 0.0, after_scan=listen)
    assert link.geometry == log.geometry
    np.testing.assert_allclose([reading.stamp_s for reading in readings], log.stamps, atol=1e-9)
    np.testing.assert_array_equal(np.stack([reading.ranges for reading in readings]), log.ranges)
    followed = follow(log, lidarium.mapping.localization.slam.following.LOG_SETTINGS)
    slam = lidarium.mapping.localization.slam.localizer.Slam(followed.slam.settings, link.geometry)
    online = [slam.localize(Sensing(each.stamp_s, each.odometry, each.ranges)) for each in readings]
    np.testing.assert_allclose(online, followed.online, atol=1e-6)


def test_the_command_plays_a_bag(bag, capsys):
    assert (
        main(
            [
                "ros",
                "play",
                str(bag),
                "--domain",
                str(DOMAIN),
                "--localhost",
                "--speed",
                "0",
                "--timeout-s",
                "0",
                "--json",
            ]
        )
        == 0
    )
    assert json.loads(capsys.readouterr().out)["messages"]["/robot_0/scan"] == 81
