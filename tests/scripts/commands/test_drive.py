"""A robot is driven by hand, beside the score of a policy."""

import json
from contextlib import contextmanager

import pytest
from recorded_scene import RecordedServer

from lidarium.evaluation.viewing import hand as viewing
from lidarium.evaluation.viewing import server as serving
from lidarium.scripts.main import main

SHORT = ["drive", "apartment", "--horizon-s", "4", "--map-resolution", "0.05", "--json"]


@pytest.fixture
def server(monkeypatch):
    """A page on which "Forward" is pressed at the start."""
    server = RecordedServer()

    @contextmanager
    def view_server(port):
        yield server

    begin = viewing.DrivenView.begin

    def begin_and_press(view, env):
        begin(view, env)
        server.gui.controls[viewing.FORWARD].press()

    monkeypatch.setattr(serving, "view_server", view_server)
    monkeypatch.setattr(serving, "address_of", lambda server: "http://127.0.0.1:1/")
    monkeypatch.setattr(viewing.DrivenView, "begin", begin_and_press)
    monkeypatch.setattr("lidarium.evaluation.viewing.controls.SPEEDS", {"1 x": float("inf"), "5 x": float("inf")})
    return server


@pytest.mark.parametrize("robots", [1, 2])
def test_a_run_by_hand_is_written_with_a_record_that_repeats(server, tmp_path, capsys, robots):
    assert main([*SHORT, "--robots", str(robots), "--out", str(tmp_path)]) == 0
    shown = capsys.readouterr()
    result = json.loads(shown.out)
    assert result["policy"] == "by_hand"
    assert len(result["path_m"]) == robots
    assert result["path_m"][0] > 0.5
    assert "drive robot_0 at http" in shown.err
    texts = [control.content for name, control in server.gui.controls.items() if name.startswith("html")]
    assert any("tour_frontier</td>" in text for text in texts)
    assert main(["replay", str(tmp_path / "episode.npz"), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["policy"] == "by_hand"


def test_a_second_drive_keeps_the_first(server, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for number in (1, 2):
        assert main([*SHORT, "--beside", "none"]) == 0
        assert len(list((tmp_path / "runs").glob("apartment-by_hand-0*/episode.npz"))) == number


def test_nothing_is_run_beside_if_nothing_is_wanted(server, tmp_path, capsys):
    assert main([*SHORT, "--beside", "none", "--out", str(tmp_path)]) == 0
    assert "explores the floor first" not in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--robots", "2", "--policy", "supervised", "--supervisor.nosuch", "5"], "nosuch"),
        (["--beside", "no_such"], "no_such"),
        (["--robots", "2", "--policy", "no_such"], "no_such"),
        (["--view-port", "70000"], "--view-port is 70000; want 0 to 65535"),
    ],
)
def test_bad_choices_are_refused_before_anything_is_written(server, tmp_path, capsys, arguments, message):
    assert main([*SHORT, *arguments, "--out", str(tmp_path / "out")]) == 2
    assert message in capsys.readouterr().err
    assert not (tmp_path / "out").exists() or not list((tmp_path / "out").iterdir())
