"""A map answers requests for paths on the command line."""

import json
from itertools import pairwise

import numpy as np
import pytest
from furnished_room import furniture

from lidarium.scripts.main import main


def test_a_path_is_planned_around_the_table(room, tmp_path, capsys):
    arguments = ["--from", "0.7,1.8", "--to", "3.3,1.8", "--radius", "0.2", "--out", str(tmp_path)]
    assert main(["plan", str(room / "maps" / "room.smap"), *arguments, "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["found"]
    assert result["length_m"] > 2.6  # the table stands between
    points = np.array(result["points"])
    top = furniture()[0]
    for a, b in pairwise(points):
        along = a + np.linspace(0.0, 1.0, 200)[:, None] * (b - a)
        gaps = np.maximum(np.maximum(top[0, :2] - along[:, :2], along[:, :2] - top[1, :2]), 0.0)
        assert np.hypot(*gaps.T).min() > 0.2 - 1e-6
    assert {path.name for path in tmp_path.iterdir()} == {"path.json", "path.png", "path_3d.png"}


def test_a_low_robot_goes_under_the_table(room, capsys):
    request = ["--from", "0.7,1.8", "--to", "3.3,1.8", "--radius", "0.2", "--height", "0.5", "--json"]
    assert main(["plan", str(room / "maps" / "room.smap"), *request]) == 0
    assert json.loads(capsys.readouterr().out)["length_m"] == pytest.approx(2.6, abs=0.05)


def test_a_goal_in_the_table_has_no_path_and_exit_code_3(room, capsys):
    assert main(["plan", str(room / "maps" / "room.smap"), "--from", "0.7,1.8", "--to", "2.2,1.8"]) == 3
    assert "goal in collision" in capsys.readouterr().out


@pytest.mark.parametrize("point", ["1", "1,2,3,4", "a,b", "nan,0"])
def test_bad_points_are_refused(room, point, capsys):
    assert main(["plan", str(room / "maps" / "room.smap"), "--from", point, "--to", "1,1"]) == 2
    assert "--from is" in capsys.readouterr().err


@pytest.mark.parametrize("point", ["100,1", "1,-3", "1,1,40"])
def test_points_outside_the_map_are_refused(room, point, capsys):
    assert main(["plan", str(room / "maps" / "room.smap"), "--from", "1,1", "--to", point]) == 2
    assert "--to is" in (told := capsys.readouterr().err)
    assert "want a point on the map: x from" in told
