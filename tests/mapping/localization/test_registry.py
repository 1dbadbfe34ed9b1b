"""Localizers are made by name."""

import numpy as np
import pytest
from driven_rooms import GEOMETRY

from lidarium.mapping.localization.localizer import Sensing
from lidarium.mapping.localization.registry import LOCALIZERS, make_localizer


def sensing(ranges, k, x=0.0):
    return Sensing(0.1 * k, np.array([x, 0.0, 0.0]), np.asarray(ranges, np.float32))


@pytest.mark.parametrize("name", LOCALIZERS)
def test_localizers_are_made_by_name(name):
    made = make_localizer(name, GEOMETRY)
    made.reset(np.array([1.0, 0.0, 0.0]), 0)
    pose = made.localize(sensing(np.full(GEOMETRY.beams, 1.0), 0))
    # Only particles are spread about the pose that they are told.
    assert pose.tolist() == [1.0, 0.0, 0.0] if name != "splines" else pose == pytest.approx([1.0, 0.0, 0.0], abs=0.005)
    assert made.covariance.shape == (3, 3)
    assert made.take_correction() is None


def test_names_without_localizer_are_refused():
    with pytest.raises(ValueError, match=r"unknown localizer 'gps'.*known: odometry, slam"):
        make_localizer("gps", GEOMETRY)
