"""Lasers, with the noise of their ranges."""

import math

import numpy as np
import pytest

from lidarium.envs.settings.lidar import LIDARS, MOST_RANGE_M, Lidar
from lidarium.mapping.grids.scan_geometry import MAX_BEAMS


def test_either_part_of_the_noise_makes_a_laser_noisy():
    assert not Lidar().is_noisy
    assert Lidar(noise_floor=0.01).is_noisy
    assert Lidar(noise_share=0.01).is_noisy
    assert not any(lidar.is_noisy for _, lidar in LIDARS.items())


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"beams": 0}, "beams of the laser is 0"),
        ({"range_max": MOST_RANGE_M + 1.0}, "range_max of the laser is 201"),
        ({"field_of_view": 7.0}, "field_of_view of the laser is 7"),
        ({"range_min": 6.0}, "range_min"),
        ({"noise_share": -0.1}, "noise_share of the laser is -0"),
    ],
)
def test_lasers_that_cannot_be_simulated_are_refused(options, message):
    with pytest.raises(ValueError, match=message):
        Lidar(**options)


@pytest.mark.parametrize(
    "options",
    [
        {"beams": 0},
        {"beams": MAX_BEAMS + 1},
        {"field_of_view": 0.0},
        {"field_of_view": 7.0},
        {"range_min": 6.0},
        {"range_min": -1.0},
        {"range_max": math.inf},
        {"range_max": math.nan},
        {"noise_floor": -0.1},
        {"noise_share": math.nan},
        {"height": 0.0},
    ],
)
def test_a_lidar_that_cannot_be_is_refused(options):
    with pytest.raises(ValueError, match=next(iter(options))):
        Lidar(**options)


def test_a_full_circle_has_equal_gaps_and_does_not_repeat_its_first_beam():
    lidar = Lidar(beams=180, field_of_view=2.0 * math.pi, range_max=6.0)
    gaps = np.diff(np.append(lidar.angles, lidar.angles[0] + 2.0 * math.pi))
    assert np.allclose(gaps, math.radians(2.0))
