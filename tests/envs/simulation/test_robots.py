import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from lidarium.envs.simulation.robots import ROBOTS, WHEELS, Wheels

RATES = st.floats(-12.0, 12.0)


@given(st.sampled_from(sorted(WHEELS)), RATES, RATES)
def test_wheel_rates_undo_speeds(name, left, right):
    wheels = WHEELS[name]
    assert wheels.wheel_rates(*wheels.speeds(left, right)) == pytest.approx((left, right), abs=1e-9)


@pytest.mark.parametrize("rates", [(4.0, 4.0), (3.0, 5.0), (-2.0, 2.0), (5.0, 1.0)])
def test_both_wheels_roll_without_slipping_along_the_arc_of_the_body(rates):
    wheels = WHEELS["pioneer"]
    speed, turn_rate = wheels.speeds(*rates)
    motion = solve_ivp(
        lambda _, pose: (speed * math.cos(pose[2]), speed * math.sin(pose[2]), turn_rate), (0.0, 1.0), (0.0, 0.0, 0.0), rtol=1e-9
    ).y[:, -1]
    radius = math.inf if turn_rate == 0.0 else speed / turn_rate
    expected = (speed, 0.0) if math.isinf(radius) else (radius * math.sin(turn_rate), radius * (1.0 - math.cos(turn_rate)))
    assert motion[:2] == pytest.approx(expected, abs=1e-6)
    for rate, side in zip(rates, (1.0, -1.0), strict=True):
        assert speed - side * turn_rate * wheels.track / 2.0 == pytest.approx(rate * wheels.radius)


def test_footprints_lie_within_the_discs_of_the_robots_that_turn_on_the_spot():
    for name, wheels in WHEELS.items():
        assert math.hypot(wheels.length, wheels.width) / 2.0 < 1.4 * ROBOTS[name].radius
        assert wheels.track < wheels.width


def test_wheels_have_sizes():
    with pytest.raises(ValueError, match="track"):
        Wheels(radius=0.1, track=0.0, ticks_per_turn=500.0, length=0.4, width=0.4)
