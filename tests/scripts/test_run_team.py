"""What `lidarium run` leaves of a team: maps that can be merged again, how they lie, and a summary."""

import json
import math

import pytest

from lidarium.envs.floors.catalogue.names import load_floor
from lidarium.mapping.files.map_files import read_ros_map
from lidarium.mapping.geometry.rigid import Transform
from lidarium.scripts.main import main

TEAM = ["run", "--robots", "2", "--noise", "none", "--map-resolution", "0.05", "--seed", "0"]


def truth():
    """How the second robot's map frame lies in the first's on the apartment."""
    first, second = (Transform(*start) for start in load_floor("apartment").starts[:2])
    return first.inverse() @ second


def off(found):
    """By how much an entry of transforms.json misses the truth [m, rad], in the middle of the apartment."""
    return Transform(found["x"], found["y"], found["theta"]).difference(truth(), (2.0, 2.0))


@pytest.fixture(scope="module")
def led(tmp_path_factory):
    """The folder of a run on the apartment by two robots that a station leads."""
    folder = tmp_path_factory.mktemp("led")
    assert main([*TEAM, "--horizon-s", "80", "--supervisor.merge-period-s", "1", "--out", str(folder)]) == 0
    return folder


def test_a_station_leaves_the_merged_map_and_how_the_robots_maps_lie(led):
    known = json.loads((led / "transforms.json").read_text())
    assert known["world"] == "robot_0"
    assert known["maps"]["robot_0"] == {"x": 0.0, "y": 0.0, "theta": 0.0, "group": 0}
    (pair,) = known["pairs"]
    assert pair["accepted"]
    for found in (known["maps"]["robot_1"], pair):
        distance, angle = off(found)
        assert distance < 0.1
        assert angle < math.radians(1.0)
    own, merged = (read_ros_map(led / f"{name}.yaml") for name in ("robot_0", "merged"))
    assert (merged.levels != 127).sum() > (own.levels != 127).sum()


def test_maps_of_a_run_can_be_merged_again(led, tmp_path, capsys):
    paths = [str(led / f"robot_{robot}.yaml") for robot in range(2)]
    assert main(["merge", *paths, "--out", str(tmp_path), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)["maps"]["robot_1"]
    distance, angle = off(found)
    assert distance < 0.1
    assert angle < math.radians(1.0)


def test_settings_of_the_supervisor_are_kept_with_the_result(led):
    result = json.loads((led / "result.json").read_text())
    assert result["policy_settings"] == {"merge_period_s": 1}
    assert result["supervisor"]["joined"] == 1


def test_the_summary_names_merges_and_orders(tmp_path, capsys):
    assert main([*TEAM, "--horizon-s", "40", "--supervisor.period_s=5", "--out", str(tmp_path)]) == 0
    told = capsys.readouterr().out
    assert "0 wrong by the truth" in told
    assert "decisions" in told


def test_robots_that_know_their_starts_say_how_their_maps_lie(tmp_path, capsys):
    arguments = [*TEAM, "--policy", "nearest_frontier", "--horizon-s", "2", "--out", str(tmp_path), "--json"]
    assert main(arguments) == 0
    capsys.readouterr()
    known = json.loads((tmp_path / "transforms.json").read_text())
    assert known["pairs"] == []
    first, second = load_floor("apartment").starts[:2]
    found = known["maps"]["robot_1"]
    # Frames of robots that know their starts have the floor's axes, and their origin in the start's cell.
    assert math.dist((found["x"], found["y"]), (second[0] - first[0], second[1] - first[1])) < 0.08
    assert found["theta"] == 0.0
    assert not (tmp_path / "merged.yaml").exists()


def test_robots_that_nobody_joins_are_alone(tmp_path, capsys):
    arguments = [*TEAM, "--policy", "independent", "--unknown-starts", "--horizon-s", "2", "--json"]
    assert main([*arguments, "--out", str(tmp_path)]) == 0
    capsys.readouterr()
    known = json.loads((tmp_path / "transforms.json").read_text())
    assert known["maps"] == {"robot_0": None, "robot_1": None}


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--supervisor.perod_s", "5"], ("perod_s", "did you mean 'period_s'?")),
        (["--supervisor.period_s", "never"], ("period_s", "never")),
        (["--supervisor.period_s"], ("--supervisor.period_s", "no value")),
        (["--supervisor", "period_s"], ("period_s", "KEY=VALUE")),
        (["--supervisor.period_s", "5", "--policy", "independent"], ("'independent'", "oracle_starts")),
    ],
)
def test_bad_settings_of_the_supervisor_are_refused_before_anything_is_written(options, words, tmp_path, capsys):
    assert main([*TEAM, *options, "--out", str(tmp_path / "out")]) == 2
    told = capsys.readouterr().err
    assert all(word in told for word in words)
    assert not (tmp_path / "out").exists()


def test_an_evaluation_takes_settings_of_the_supervisor(tmp_path, capsys):
    arguments = ["evaluate", "--policies", "supervised", "nearest_frontier", "--robots", "2", "--seeds", "1"]
    settings = ["--horizon-s", "1", "--workers", "1", "--supervisor.period_s", "5"]
    assert main([*arguments, *settings, "--unknown-starts", "--out", str(tmp_path), "--json"]) == 0
    capsys.readouterr()
    kept = json.loads((tmp_path / "suite.json").read_text())["policy_settings"]
    assert kept == {"supervised": {"period_s": 5}}


def test_an_evaluation_without_a_supervisor_takes_no_settings_of_one(tmp_path, capsys):
    arguments = ["evaluate", "--policies", "nearest_frontier", "--supervisor.period_s", "5"]
    assert main([*arguments, "--out", str(tmp_path / "out")]) == 2
    assert "'nearest_frontier'" in capsys.readouterr().err
