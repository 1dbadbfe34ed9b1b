"""By how much dead reckoning may err."""

import numpy as np
import pytest

from lidarium.mapping.localization.matching.settings.odometry import OdometryUncertainty

PLAIN = OdometryUncertainty(distance_floor=0.01, turn_floor=0.02)


def test_errors_grow_with_the_motion_from_a_floor():
    np.testing.assert_allclose(np.sqrt(np.diag(PLAIN.covariance(0.0, 0.0))), (0.01, 0.01, 0.02))
    np.testing.assert_allclose(np.sqrt(np.diag(PLAIN.covariance(2.0, -0.5))), (0.21, 0.21, 0.05 + 0.1 + 0.02))


def test_random_errors_add_up_as_squares_and_turn_no_way():
    floor = np.diag([1e-4, 1e-4, 4e-4])
    np.testing.assert_allclose(PLAIN.noise(0.0, 0.0), floor)
    once, twice = PLAIN.noise(1.0, 0.4) - floor, PLAIN.noise(2.0, 0.8) - floor
    np.testing.assert_allclose(twice, 2.0 * once)
    np.testing.assert_allclose(PLAIN.noise(-1.0, -0.4), PLAIN.noise(1.0, 0.4))


@pytest.mark.parametrize(("name", "value"), [("turn_share", 0.0), ("fading", 1.0), ("most_deviations", -1.0)])
def test_settings_that_make_no_sense_are_refused(name, value):
    with pytest.raises(ValueError, match=name):
        OdometryUncertainty(**{name: value})
