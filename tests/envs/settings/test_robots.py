"""The robots of the catalogue."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lidarium.envs.settings.robots import ROBOTS, Robot

SPEEDS = st.floats(-2.0, 2.0)


@given(st.sampled_from(sorted(ROBOTS)), SPEEDS, SPEEDS)
def test_wheel_speeds_and_motion_of_the_body_are_inverse_to_each_other(name, left, right):
    robot = ROBOTS[name]
    assert robot.wheel_speeds(*robot.body_motion(left, right)) == pytest.approx((left, right), abs=1e-12)


def test_wheels_that_turn_against_each_other_turn_the_body_on_the_spot():
    robot = ROBOTS["pioneer"]
    assert robot.body_motion(-0.1, 0.1) == pytest.approx((0.0, 0.2 / 0.331))
    assert robot.body_motion(0.1, 0.1) == pytest.approx((0.1, 0.0))


def test_a_wheel_that_stands_is_the_middle_of_the_turn():
    robot = ROBOTS["kobuki"]
    speed, turn_rate = robot.body_motion(0.0, 0.2)
    assert speed / turn_rate == pytest.approx(robot.wheel_base / 2.0)


@pytest.mark.parametrize("name", ["kobuki", "pioneer"])
def test_outlines_lie_within_the_disc_and_wheels_within_the_outline(name):
    robot = ROBOTS[name]
    assert max(robot.length, robot.width) / 2.0 <= robot.radius
    assert robot.wheel_base <= robot.width


def test_the_pioneer_counts_500_ticks_in_a_turn_of_its_wheel():
    assert ROBOTS["pioneer"].ticks_per_metre * 2.0 * math.pi * 0.0975 == pytest.approx(500.0)


def test_numbers_that_make_no_body_are_refused():
    with pytest.raises(ValueError, match=r"wheel_base of the robot is 0.0; want a number above 0"):
        Robot(wheel_base=0.0)
