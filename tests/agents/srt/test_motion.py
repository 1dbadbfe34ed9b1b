"""Drives turn, advance and stop before what the laser sees."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from lidarium.agents.srt.motion import ASIDES, TEAMMATE_NEAR, Blocks, Drive, Limits, Phase, Remedy, driven, free_way
from lidarium.agents.srt.settings import SrtSettings
from lidarium.mapping.grids.scan_geometry import ScanGeometry

URG = ScanGeometry()
LIMITS = Limits(0.4, 1.0, 0.5, 0.18)


@pytest.mark.parametrize("kind", ["turn_advance", "controls"])
@pytest.mark.parametrize("target", [(1.0, 0.5), (-1.0, 0.1), (0.0, -0.8)])
def test_a_drive_turns_advances_and_is_done(kind, target):
    wanted, drive, pose = SrtSettings(drive=kind), Drive(np.array(target)), np.zeros(3)
    phases = []
    for _ in range(300):
        drive, speed, turn_rate = driven(drive, pose, 5.0, LIMITS, wanted, 0.1)
        phases.append(drive.phase)
        if drive.phase is Phase.DONE:
            break
        assert 0.0 <= speed <= LIMITS.speed
        assert abs(turn_rate) <= LIMITS.turn_rate
        pose = pose + 0.1 * np.array([speed * math.cos(pose[2]), speed * math.sin(pose[2]), turn_rate])
    assert phases[-1] is Phase.DONE
    assert Phase.ADVANCE in phases
    assert math.dist(pose[:2], target) <= 0.1


def test_a_robot_turns_to_where_its_way_leads_exactly_where_something_is_near():
    aside = np.array([2.0 * math.cos(0.2), 2.0 * math.sin(0.2)])
    for free, phase in ((3.0, Phase.ADVANCE), (0.3, Phase.TURN)):
        drive, speed, _ = driven(Drive(aside), np.zeros(3), free, LIMITS, SrtSettings(), 0.1)
        assert drive.phase is phase
        assert (speed > 0.0) == (phase is Phase.ADVANCE)
    drive, speed, _ = driven(Drive(aside), np.array([0.0, 0.0, 0.19]), 0.3, LIMITS, SrtSettings(), 0.1)
    assert speed > 0.0


@pytest.mark.parametrize("beside", [0.182, 0.189, 0.195])
def test_a_wall_beside_the_robot_is_no_end_of_a_way_along_it(beside):
    scan = np.full(727, 5.6, np.float32)
    left = np.flatnonzero(URG.angles > math.radians(10.0))
    scan[left] = np.minimum(beside / np.sin(np.minimum(URG.angles[left], math.pi / 2)), 5.6)
    assert free_way(scan, URG, 0.18) == pytest.approx(5.6)
    # Towards the wall the way ends where the body would touch it.
    assert free_way(scan, URG, 0.18, heading=math.radians(30.0)) < 0.05


def test_a_drive_stops_before_what_the_laser_sees_ahead():
    scan = np.full(727, 5.6, np.float32)
    assert free_way(scan, URG, 0.18) == pytest.approx(5.6)
    scan[363] = 1.0
    assert free_way(scan, URG, 0.18) == pytest.approx(0.81, abs=0.01)
    scan[:300] = 0.3
    assert free_way(np.full(727, np.nan, np.float32), URG, 0.18) == pytest.approx(5.6)
    _, speed, _ = driven(Drive(np.array([2.0, 0.0]), Phase.ADVANCE), np.zeros(3), 0.02, LIMITS, SrtSettings(), 0.1)
    assert speed == 0.0


def senses(*gaps):
    return SimpleNamespace(teammates=list(gaps), distance_to=lambda gap: gap)


def test_alone_a_robot_backs_out_and_every_third_time_steps_aside():
    blocks = Blocks()
    found = [blocks.remedy(senses(), here, is_goal=False) for here in range(4)]
    assert found == [Remedy.BACK_OUT, Remedy.BACK_OUT, Remedy.STEP_ASIDE, Remedy.BACK_OUT]
    assert blocks.asides == 0


@pytest.mark.parametrize(
    ("gap", "expected"), [(TEAMMATE_NEAR - 0.1, Remedy.STEP_ASIDE), (TEAMMATE_NEAR, Remedy.BACK_OUT)]
)
def test_a_robot_steps_aside_for_a_teammate_that_is_near(gap, expected):
    assert Blocks().remedy(senses(9.0, gap), 0, is_goal=False) is expected


def test_after_many_steps_aside_a_robot_backs_out_and_begins_anew():
    blocks = Blocks()
    found = [blocks.remedy(senses(0.5), 0, is_goal=False) for _ in range(ASIDES + 2)]
    assert found == [Remedy.STEP_ASIDE] * ASIDES + [Remedy.BACK_OUT, Remedy.STEP_ASIDE]


def test_a_goal_is_given_up_once_it_is_hopeless():
    blocks = Blocks()
    for _ in range(ASIDES):
        assert blocks.remedy(senses(), 0, is_goal=True) is not Remedy.GIVE_GOAL_UP
    assert not blocks.are_hopeless
    assert blocks.remedy(senses(), 0, is_goal=True) is Remedy.GIVE_GOAL_UP
    assert blocks.failures == 0
