"""Lasers, with the noise of their ranges."""

import pytest

from lidarium.envs.settings.lidar import LIDARS, MOST_RANGE_M, Lidar


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
