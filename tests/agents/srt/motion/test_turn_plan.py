"""Turns of a robot on the spot."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from lidarium.agents.srt.motion.turn_plan import MOST_TURNS, TurnPlan


def facing(heading, x=0.0, y=0.0):
    return SimpleNamespace(pose=np.array([x, y, heading]))


def lidar(degrees, beams=100):
    return SimpleNamespace(field_of_view=math.radians(degrees), beams=beams)


def headings_of(plan):
    found = []
    while not plan.is_over:
        found.append(plan.error(facing(0.0)))
        plan.end_turn()
    return found


@pytest.mark.parametrize("degrees", [60.0, 90.0, 120.0, 240.0, 270.0])
@pytest.mark.parametrize("heading", [0.0, 2.5])
def test_after_all_turns_the_whole_circle_was_seen(degrees, heading):
    plan = TurnPlan()
    plan.plan_circle(facing(heading), lidar(degrees))
    headings = [heading, *headings_of(plan)]
    assert len(headings) == math.ceil(360.0 / degrees)
    around = np.linspace(-math.pi, math.pi, 721)
    gaps = np.abs([np.angle(np.exp(1j * (around - each))) for each in headings]).min(axis=0)
    assert gaps.max() <= math.radians(degrees) / 2.0 + 1e-9


@pytest.mark.parametrize(
    "laser",
    [lidar(360.0), lidar(360.0 / (MOST_TURNS + 2)), lidar(240.0, beams=1)],
    ids=["full", "narrow", "beam"],
)
def test_a_laser_that_sees_all_or_hardly_anything_does_not_turn(laser):
    plan = TurnPlan()
    plan.plan_circle(facing(0.0), laser)
    assert plan.is_over


def test_a_robot_turns_to_a_frontier_the_short_distance():
    plan = TurnPlan()
    focus = np.array([-1.0, 2.0])
    plan.plan_frontier(focus, facing(3.0, 1.0, 2.0))
    assert plan.focus is focus
    assert plan.error(facing(3.0)) == pytest.approx(math.pi - 3.0)
    assert plan.error(facing(-3.0)) == pytest.approx(3.0 - math.pi)
    plan.end_turn()
    assert plan.is_over
    assert plan.focus is focus
