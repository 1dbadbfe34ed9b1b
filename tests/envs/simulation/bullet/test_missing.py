"""Where PyBullet is not installed."""

import sys

import pytest

from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.settings.making import make_settings
from lidarium.envs.simulation.backends import BACKENDS
from lidarium.scripts.commands.run import Run


def test_the_error_names_the_extra_before_anything_starts(monkeypatch):
    monkeypatch.setitem(sys.modules, "pybullet", None)
    settings = make_settings(backend="bullet")
    with pytest.raises(ValueError, match=r"PyBullet, whose wheels end at CPython 3.11: pip install"):
        ExplorationEnv("apartment", settings)


def test_the_command_line_knows_the_backend():
    assert "bullet" in BACKENDS.summaries
    assert Run(backend="bullet").team_options["backend"] == "bullet"
    assert "backend" not in Run().team_options
