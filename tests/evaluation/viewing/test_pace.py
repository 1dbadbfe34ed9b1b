"""Simulated time keeps step with the clock, at a speed that may change, and stands while it is held."""

import math

import pytest

from lidarium.evaluation.viewing.pace import LONGEST_WAIT_S, MOST_BEHIND_S, Pace


class Wall:
    """A clock that sleeping turns on."""

    def __init__(self):
        self.now = 100.0

    def sleep(self, seconds):
        assert seconds >= 0.0
        self.now += seconds


@pytest.fixture
def wall():
    return Wall()


@pytest.fixture
def pace(wall):
    return Pace(lambda: wall.now, wall.sleep)


def drive(pace, times, speed, is_held=lambda: False, meanwhile=lambda: True):
    for time_s in times:
        pace.wait(time_s, speed, is_held, meanwhile)


def test_two_simulated_seconds_take_one_at_twice_the_speed(pace, wall):
    drive(pace, [0.1 * k for k in range(1, 102)], lambda: 2.0)
    assert wall.now - 100.0 == pytest.approx(5.0)


def test_as_fast_as_it_goes_waits_for_nothing(pace, wall):
    drive(pace, range(1, 1000), lambda: math.inf)
    assert wall.now == 100.0


def test_a_speed_that_is_chosen_later_counts_from_then_on(pace, wall):
    speed = [1.0]
    drive(pace, [1.0, 2.0], lambda: speed[0])
    speed[0] = 10.0
    drive(pace, [3.0, 13.0], lambda: speed[0])
    assert wall.now - 100.0 == pytest.approx(1.0 + 1.0, abs=1e-6)


def test_a_late_run_does_not_hurry_after_the_clock(pace, wall):
    drive(pace, [1.0], lambda: 1.0)
    wall.now += 20.0 * MOST_BEHIND_S
    drive(pace, [1.1], lambda: 1.0)
    late = wall.now
    drive(pace, [1.2, 2.1], lambda: 1.0)
    assert wall.now - late == pytest.approx(1.0)


def test_time_stands_while_it_is_held_and_goes_on_from_there(pace, wall):
    drive(pace, [1.0], lambda: 1.0)
    drive(pace, [2.0], lambda: 1.0, is_held=lambda: wall.now < 150.0)
    released = wall.now
    assert released >= 150.0
    drive(pace, [3.0], lambda: 1.0)
    assert wall.now - released == pytest.approx(1.0, abs=LONGEST_WAIT_S + 1e-6)


def test_who_is_not_to_wait_any_more_does_not(pace, wall):
    asked = iter([True, True, False])
    drive(pace, [1.0], lambda: 1.0, is_held=lambda: True, meanwhile=lambda: next(asked))
    assert wall.now < 101.0
