"""An episode as a bag: scans, poses, maps and paths are those of the episode."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("rosbags", reason="rosbags is not installed: extra [bags]")
pytest.importorskip("mcap_ros2", reason="mcap-ros2-support is not installed")

from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from lidarium.envs.settings.lidar import Lidar
from lidarium.evaluation.record.bag import write_bag
from lidarium.evaluation.record.replay import drive_again
from lidarium.evaluation.truth.beliefs import maps_on_floor
from lidarium.mapping.files.bags.reading import read_bag_log
from lidarium.mapping.files.npz_logs import write_npz_log
from lidarium.mapping.geometry.rigid import composed
from lidarium.scripts.main import main


@pytest.fixture(scope="module")
def episode(recorded, tmp_path_factory):
    """The record of an episode with wheels that slip, and its bag."""
    record, env = recorded(
        "nearest_frontier",
        known_starts=False,
        resolution=0.05,
        horizon_s=12.0,
        localization="odometry",
        odometry="poor",
    )
    path = tmp_path_factory.mktemp("bag") / "episode.mcap"
    write_bag(path, record)
    return record, env, path


def messages(path, *topics):
    with open(path, "rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        return [(channel.topic, content) for _, channel, _, content in reader.iter_decoded_messages(topics)]


def planar(place, turn):
    return np.array([place.x, place.y, 2.0 * np.arctan2(turn.z, turn.w)])


def test_scans_and_odometry_are_those_of_the_robots(episode):
    record, env, path = episode
    log = read_bag_log(path, "/robot_1/scan")
    assert len(log.stamps) == len(record.commands) + 1
    assert np.array_equal(log.ranges[-1], env.simulation.ranges[1])
    assert np.allclose(log.odometry[-1], env.simulation.odometry[1], atol=1e-9)
    half = len(record.commands) // 2
    again = drive_again(replace(record, commands=record.commands[:half], header={**record.header, "endings": []}))
    assert np.array_equal(log.ranges[half], again.simulation.ranges[1])


def test_scans_have_the_angles_and_ranges_of_the_own_lidar(recorded, tmp_path):
    lidars = [Lidar(beams=91, range_max=2.0), Lidar(beams=91, range_max=8.0, field_of_view=3.0)]
    record, env = recorded("nearest_frontier", resolution=0.05, horizon_s=2.0, lidar=lidars)
    write_bag(tmp_path / "episode.mcap", record)
    for row, lidar in enumerate(env.settings.team_lidars):
        (_, scan), *_ = messages(tmp_path / "episode.mcap", f"/robot_{row}/scan")
        found = (scan.range_max, scan.angle_min, scan.angle_increment)
        assert found == pytest.approx((lidar.range_max, lidar.angle_first, lidar.angle_increment), abs=1e-6)


def test_transforms_lead_from_the_map_to_the_true_pose(episode):
    _, env, path = episode
    chain = {}
    for _, content in messages(path, "/tf"):
        for each in content.transforms:
            frames = each.header.frame_id, each.child_frame_id
            chain[frames] = planar(each.transform.translation, each.transform.rotation)
    for row, robot in enumerate(env.possible_agents):
        found = composed(chain["map", f"{robot}/odom"], chain[f"{robot}/odom", f"{robot}/base_link"])
        assert np.allclose(found[:2], env.world.poses[row, :2], atol=1e-9)
        assert np.cos(found[2] - env.world.poses[row, 2]) == pytest.approx(1.0)


def test_ideal_odometry_moves_as_the_robot_does(recorded, tmp_path):
    record, env = recorded("nearest_frontier", resolution=0.05, horizon_s=12.0)
    write_bag(tmp_path / "ideal.mcap", record)
    starts = {}
    for _, content in messages(tmp_path / "ideal.mcap", "/tf"):
        for each in content.transforms:
            if each.header.frame_id == "map":
                starts.setdefault(each.child_frame_id, []).append(
                    planar(each.transform.translation, each.transform.rotation)
                )
    for row, robot in enumerate(env.possible_agents):
        found = np.array(starts[f"{robot}/odom"])
        assert np.abs(found[:, :2] - found[0, :2]).max() < 1e-9
        log = read_bag_log(tmp_path / "ideal.mcap", f"/{robot}/scan")
        assert log.odometry is not None
        assert np.allclose(composed(found[0], log.odometry[-1])[:2], env.world.poses[row, :2], atol=1e-9)
        assert np.hypot(*np.diff(log.odometry[:, :2], axis=0).T).sum() > 1.0


def test_maps_and_paths_at_the_end_are_those_of_the_episode(episode):
    _, env, path = episode
    maps = maps_on_floor(env)
    for topic, log_odds in (("/map", maps.sum(axis=0, dtype=np.int16)), ("/robot_0/map", maps[0])):
        *_, (_, grid) = messages(path, topic)
        cells = np.array(grid.data, np.int64).reshape(grid.info.height, grid.info.width)
        assert np.array_equal(cells, np.where(log_odds > 0, 100, np.where(log_odds < 0, 0, -1)))
        assert (grid.info.origin.position.x, grid.info.origin.position.y) == env.world.floors[0].laser.origin
        assert grid.info.resolution == pytest.approx(0.05)
    *_, (_, driven) = messages(path, "/robot_0/path")
    last = driven.poses[-1].pose
    assert np.allclose(planar(last.position, last.orientation)[:2], env.world.poses[0, :2], atol=1e-9)


def test_slam_on_the_bag_is_slam_on_the_log(episode, tmp_path):
    _, _, path = episode
    write_npz_log(tmp_path / "log.npz", read_bag_log(path, "/robot_0/scan"))
    assert main(["slam", str(path), "--topic", "/robot_0/scan", "--out", str(tmp_path / "bag")]) == 0
    assert main(["slam", str(tmp_path / "log.npz"), "--out", str(tmp_path / "log")]) == 0
    for name in ("trajectory.tum", "map.pgm", "map.yaml"):
        assert (tmp_path / "bag" / name).read_bytes() == (tmp_path / "log" / name).read_bytes()


def test_a_topic_has_to_be_chosen_of_a_team(episode, tmp_path, capsys):
    assert main(["slam", str(episode[2]), "--out", str(tmp_path / "out")]) == 2
    assert "choose one by --topic: /robot_0/scan, /robot_1/scan" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_record_that_cannot_run_again_leaves_no_bag(episode, tmp_path):
    record, _, _ = episode
    other = replace(record, header={**record.header, "version": "9.9.9"})
    with pytest.raises(ValueError, match=r"the record is of lidarium 9\.9\.9"):
        write_bag(tmp_path / "out.mcap", other)
    assert list(tmp_path.iterdir()) == []
