"""The maps that a team leaves, and how they lie."""

import json

import pytest
from short_runs import short_run

from lidarium.envs.faces.merged_maps import true_frames
from lidarium.mapping.files.map_files import read_ros_map
from lidarium.scripts.output.team_files import write_team


def test_a_lone_robot_leaves_its_map_and_no_frames(tmp_path):
    assert write_team(tmp_path, short_run(robots=1)) == ["robot_0.yaml", "robot_0.pgm"]
    assert (read_ros_map(tmp_path / "robot_0.yaml").levels == 255).sum() > 1000


def test_robots_that_know_their_starts_lie_as_they_started(tmp_path):
    episode = short_run()
    files = write_team(tmp_path, episode)
    assert sorted(files) == sorted(path.name for path in tmp_path.iterdir())
    maps = json.loads((tmp_path / "transforms.json").read_text())["maps"]
    true = true_frames(episode.env)["robot_0", "robot_1"]
    found = maps["robot_1"]
    assert (found["x"], found["y"], found["theta"]) == pytest.approx((true.x, true.y, true.theta), abs=1e-6)
    assert found["group"] == maps["robot_0"]["group"] == 0


def test_robots_that_nobody_joins_lie_nowhere(tmp_path):
    write_team(tmp_path, short_run("nearest_frontier_own_map", known_starts=False))
    known = json.loads((tmp_path / "transforms.json").read_text())
    assert known["maps"] == {"robot_0": None, "robot_1": None}
    assert known["pairs"] == []
