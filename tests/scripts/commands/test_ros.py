"""Commands of ROS 2 refuse what they cannot do before they speak to anybody."""

import re
import sys

import pytest

from lidarium.scripts.main import main


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["drive", "--map"], "--map is set, and SLAM makes a map of its own; want --localization tf"),
        (["drive", "--namespaces", "a", "a"], "namespaces are a, a; want a different one for each robot"),
        (["drive", "--extent", "1"], "extent is 1.0; want 4 to 200"),
        (["drive", "--stale-s", "nan"], "stale_s is nan; want 0.05 to 60"),
        (["drive", "--robot", "nosuch"], "unknown robot 'nosuch'"),
        (["drive", "--map-resolution", "0"], "resolution"),
        (["serve", "--speed", "-1"], "speed is -1.0; want 0 to 1000"),
        (["play", "run.mcap", "--speed", "nan"], "speed is nan; want 0 to 1000"),
        (["play", "run.mcap", "--out", "a"], "--out is given, but the command writes no files; leave it out"),
        (["serve", "--out", "a"], "--out is given, but the command writes no files; leave it out"),
        (["serve", "--merging"], "--merging is given, but robots are driven from outside; leave it out"),
        (["serve", "--supervisor.period_s", "5"], "--supervisor is given, but robots are driven from outside"),
    ],
)
def test_options_that_make_no_sense_are_refused(words, message, capsys):
    assert main(["ros", *words]) == 2
    said = re.sub(r"[\s│]+", " ", capsys.readouterr().err)  # in a frame, in lines
    assert message in said


def test_without_the_extra_the_command_says_how_to_install_it(monkeypatch, capsys):
    for name in ("graph", "messages"):
        monkeypatch.delitem(sys.modules, f"lidarium.envs.ros.{name}", raising=False)
    monkeypatch.setitem(sys.modules, "cyclonedds.builtin", None)
    assert main(["ros", "play", "run.mcap"]) == 2
    said = capsys.readouterr().err
    assert "ROS 2 needs the package cyclonedds: pip install" in said


def test_a_domain_that_does_not_exist_is_refused(capsys):
    pytest.importorskip("cyclonedds", reason="cyclonedds (extra ros) is not installed")
    assert main(["ros", "play", "run.mcap", "--domain", "500"]) == 2
    assert "domain is 500; want 0 to 232" in capsys.readouterr().err


def test_a_bag_that_does_not_exist_is_named(capsys, tmp_path):
    pytest.importorskip("cyclonedds", reason="cyclonedds (extra ros) is not installed")
    assert main(["ros", "play", str(tmp_path / "no.mcap"), "--domain", "99", "--localhost"]) == 2
    assert "no.mcap" in capsys.readouterr().err
