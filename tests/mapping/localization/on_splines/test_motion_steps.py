"""Motions are split into a turn, a straight segment and a turn, and joined again."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lidarium.mapping.geometry.rigid import Transform, composed
from lidarium.mapping.localization.on_splines.motion_steps import driven, steps_of


def test_backing_up_is_not_two_half_turns():
    first, distance, second = steps_of(Transform(-0.2, 0.01, 0.05))
    assert abs(first) < 0.1
    assert distance == pytest.approx(-math.hypot(0.2, 0.01))
    assert first + second == pytest.approx(0.05)
    assert steps_of(Transform(0.0, 0.0, 0.3)) == (0.0, 0.0, 0.3)


@given(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0), st.floats(-3.0, 3.0), st.floats(-3.0, 3.0))
def test_steps_lead_where_the_motion_leads(x, y, turn, heading):
    pose, motion = np.array([1.0, -2.0, heading]), Transform(x, y, turn)
    found = driven(pose[None], np.array([steps_of(motion)]))[0]
    expected = composed(pose, np.array([x, y, turn]))
    # Motions of less than a millimetre have no direction.
    assert math.dist(found[:2], expected[:2]) < 2.1e-3
    assert abs(math.remainder(found[2] - expected[2], 2.0 * math.pi)) < 1e-9
