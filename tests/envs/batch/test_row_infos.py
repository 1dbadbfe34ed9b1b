"""What a batch says of its rows beside their observations."""

import numpy as np
import pytest

from lidarium.envs.engine.infos import RowInfos
from lidarium.envs.simulation.endings import REASONS
from lidarium.envs.settings.making import make_settings
from lidarium.envs.simulation.backends import make_kinematic


def infos_of(reasons, camera=None):
    simulation = make_kinematic(make_settings(robots=2, camera=camera), 2)
    made, reasons = RowInfos(simulation), np.array(reasons, np.int8)
    made.begin(np.ones(4, np.bool_))
    return made, made.of_step({"area": np.arange(4.0)}, reasons, bool(reasons.any())), simulation


def test_rows_that_end_have_their_reason_and_the_others_operate():
    stopped = 1
    _, infos, _ = infos_of([0, stopped, 0, 0])
    assert infos["ended_because"].tolist() == [None, REASONS[stopped], None, None]
    assert infos["_ended_because"].tolist() == [False, True, False, False]
    assert infos["state"][[0, 2, 3]].tolist() == ["operating"] * 3
    assert infos["state"][1] != "operating"


def test_without_endings_nothing_is_said_of_them():
    _, infos, simulation = infos_of([0, 0, 0, 0])
    assert "ended_because" not in infos
    assert set(infos["state"]) == {"operating"}
    infos["truth"]["pose"][:] = 9.0
    assert not simulation.world.poses.any()


def test_what_was_handed_out_stays_as_it_is_and_cannot_be_written_to():
    made, before, _ = infos_of([0, 0, 0, 0])
    after = made.of_step({}, np.array([1, 0, 0, 0], np.int8), True)
    assert before["state"][0] == "operating" != after["state"][0]
    with pytest.raises(ValueError, match="read-only"):
        after["state"][1] = "paused"
    made.begin(np.array([True, False, False, False]))
    assert made.of_step({}, np.zeros(4, np.int8), False)["state"].tolist() == ["operating"] * 4


def test_cameras_are_described_for_each_row():
    _, infos, simulation = infos_of([0, 0, 0, 0], camera="depth_64x48")
    pinhole = simulation.camera.camera.intrinsics
    assert infos["camera"]["intrinsics"]["fx"].tolist() == [pinhole.fx] * 4
    assert infos["camera"]["mount"].shape == (4, 5)
    assert "camera" not in infos_of([0, 0, 0, 0])[1]
