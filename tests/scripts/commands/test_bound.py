"""`lidarium bound` from the command line."""

import json
import sys

import cv2
import numpy as np
import pytest

from lidarium.extras import install_command
from lidarium.scripts.main import main


def test_the_bound_is_printed_and_drawn(tmp_path, capsys):
    pytest.importorskip("ortools", reason="OR-Tools is not installed")
    arguments = ["bound", "apartment:3", "--map-resolution", "0.05", "--rounds", "20", "--json"]
    assert main([*arguments, "--out", str(tmp_path / "out")]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["seen"] >= 0.99
    assert 0.0 < result["time_s"] < 200.0
    assert json.loads((tmp_path / "out" / "bound.json").read_text()) == result
    assert (tmp_path / "out" / "bound.png").stat().st_size > 5000


def test_without_the_extra_the_message_names_it(monkeypatch, capsys, tmp_path):
    monkeypatch.setitem(sys.modules, "ortools.constraint_solver", None)
    monkeypatch.setenv("LIDARIUM_FLOOR_STORE", "off")
    out = tmp_path / "out"
    assert main(["bound", "apartment:3", "--map-resolution", "0.05", "--rounds", "0", "--out", str(out)]) == 2
    assert install_command("bounds") in capsys.readouterr().err
    assert not out.exists() or not list(out.iterdir())


def test_draws_come_from_the_seed(monkeypatch):
    seeds = []

    def known_floor_bound(floor, settings, starts, rounds, seed):
        seeds.append(seed)
        raise ValueError("nothing is planned")

    monkeypatch.setattr("lidarium.evaluation.bounds.bound.known_floor_bound", known_floor_bound)
    assert main(["bound", "apartment:3", "--map-resolution", "0.05", "--seed", "5"]) == 2
    assert seeds == [5]


@pytest.mark.parametrize("option", ["--merging", "--plans-sparsely", "--supervisor.merge_period_s=2"])
def test_options_of_policies_are_refused(option, capsys):
    assert main(["bound", "apartment:3", option]) == 2
    assert "no policy drives in a bound" in capsys.readouterr().err


@pytest.mark.parametrize(("change", "option"), [("robots=2", "--robots"), ("stop_coverage=0.5", "--coverage")])
def test_what_has_an_option_is_not_set_besides(change, option, capsys):
    assert main(["bound", "apartment:3", "--set", change]) == 2
    assert f"want {option} alone" in capsys.readouterr().err


def test_a_plain_image_is_a_floor_with_a_resolution(tmp_path, capsys):
    pytest.importorskip("ortools", reason="OR-Tools is not installed")
    room = np.zeros((40, 40), np.uint8)
    room[2:38, 2:38] = 255
    path = tmp_path / "room.png"
    cv2.imwrite(str(path), room)
    arguments = ["bound", str(path), "--map-resolution", "0.05", "--rounds", "1", "--json"]
    assert main(arguments) == 2
    assert "(--resolution)" in capsys.readouterr().err
    assert main([*arguments, "--resolution", "0.1"]) == 0
    assert json.loads(capsys.readouterr().out)["seen"] >= 0.99
