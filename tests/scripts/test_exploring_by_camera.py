"""Robots that explore by depth cameras, from the command line."""

import json

import pytest

from lidarium.evaluation.suites.episodes_file import read_episodes
from lidarium.mapping.sparse.map_files import read_sparse_map
from lidarium.scripts.main import main


def test_a_run_by_camera_mounts_one_and_writes_maps_that_can_be_planned_on(tmp_path, capsys):
    out = tmp_path / "out"
    arguments = ["run", "--policy", "sparse_frontier", "--floor", "scene_room", "--robots", "1"]
    assert main([*arguments, "--horizon-s", "30", "--out", str(out), "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["policy"] == "sparse_frontier"
    assert result["path_m"][0] > 2.0
    assert result["collisions"] == 0
    names = {path.name for path in out.iterdir()}
    assert {"view.png", "robot_0.smap", "robot_0.png", "robot_0_3d.png"} <= names
    sparse_map, _ = read_sparse_map(out / "robot_0.smap")
    assert len(sparse_map.free) > 20
    low, high = sparse_map.free[:, :2].min(axis=0), sparse_map.free[:, :2].max(axis=0)
    ends = [f"{x:.2f},{y:.2f}" for x, y in (0.7 * low + 0.3 * high, 0.3 * low + 0.7 * high)]
    assert main(["plan", str(out / "robot_0.smap"), "--from", ends[0], "--to", ends[1], "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["found"]
    assert answer["remarks"] == []


def test_a_run_without_a_policy_that_maps_writes_no_sparse_map(tmp_path, capsys):
    out = tmp_path / "out"
    arguments = ["run", "--policy", "nearest_frontier", "--floor", "scene_room", "--robots", "1"]
    assert main([*arguments, "--camera", "depth_64x48", "--horizon-s", "3", "--out", str(out)]) == 0
    names = {path.name for path in out.iterdir()}
    assert "view.png" in names
    assert not [name for name in names if name.endswith(".smap")]


def test_policies_of_both_kinds_are_evaluated_with_the_same_camera(tmp_path):
    arguments = ["--policies", "sparse_frontier", "nearest_frontier", "--floors", "scene_room"]
    short = ["--robots", "1", "--seeds", "1", "--horizon-s", "4", "--workers", "1", "--no-records"]
    assert main(["evaluate", *arguments, *short, "--camera", "xtion_tilted", "--out", str(tmp_path)]) == 0
    policies = [line["policy"] for line in read_episodes(tmp_path / "episodes.jsonl")]
    assert sorted(policies) == ["nearest_frontier", "sparse_frontier"]


@pytest.mark.parametrize("command", [["evaluate", "--policies"], ["run", "--set", "camera.pitch=-0.8", "--policy"]])
def test_without_a_camera_that_sees_the_ground_nothing_begins(command, tmp_path, capsys):
    out = tmp_path / "out"
    assert main([*command, "sparse_frontier", "--out", str(out)]) == 2
    told = capsys.readouterr()
    assert "camera" in told.err
    assert "Traceback" not in told.err
    assert not out.exists()
