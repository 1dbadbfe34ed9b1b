"""The tutorial of driving by hand runs as it stands."""

import re
from pathlib import Path

import numpy as np
import pytest

import lidarium
from lidarium.scripts.main import main

pytest.importorskip("torch", reason="torch is not installed: extra [rl]")
PAGE = Path(__file__).parents[2] / "docs" / "tutorials" / "drive_by_hand.md"


class Turns(lidarium.Policy):
    """Drives along a circle, as a person might."""

    level = "velocity"

    def reset(self, team, seed=0):
        pass

    def act(self, observations):
        return {agent: np.array([0.6, 0.3], np.float32) for agent in observations}


def test_a_network_imitates_what_was_driven(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    lidarium.record(Turns(), path="episode.npz", settings=lidarium.make_settings(horizon_s=6.0))
    assert main(["replay", "episode.npz", "--demonstrations", "mine.npz"]) == 0
    (program,) = re.findall(r"^```python\n(.*?)^```", PAGE.read_text("utf-8"), re.DOTALL | re.MULTILINE)
    capsys.readouterr()
    made = {"__name__": "imitation"}
    exec(compile(program, str(PAGE), "exec"), made)
    assert "% explored" in capsys.readouterr().out
    np.testing.assert_allclose(made["action"], [0.6, 0.3], atol=0.1)
