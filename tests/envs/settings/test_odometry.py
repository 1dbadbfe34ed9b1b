"""How well wheels measure."""

import pytest

from lidarium.envs.settings.odometry import ODOMETRY, OdometrySettings


def test_numbers_are_in_the_order_in_which_kernels_read_them():
    made = OdometrySettings(
        turn_noise_of_turn=1.0,
        turn_noise_of_distance=2.0,
        distance_noise_of_distance=3.0,
        distance_noise_of_turn=4.0,
        counts_ticks=True,
        speed_noise=6.0,
        turn_rate_noise=7.0,
    )
    assert made.numbers.tolist() == [1.0, 2.0, 3.0, 4.0, 1.0, 6.0, 7.0]


def test_only_exact_wheels_are_ideal():
    assert OdometrySettings().is_ideal
    assert not OdometrySettings(counts_ticks=True).is_ideal
    assert [name for name, made in ODOMETRY.items() if made.is_ideal] == ["ideal"]


def test_either_noise_of_the_drive_disturbs_it():
    assert OdometrySettings(speed_noise=0.1).disturbs_drives
    assert OdometrySettings(turn_rate_noise=0.1).disturbs_drives
    assert not OdometrySettings(distance_bias=0.5, drift=1.0).disturbs_drives


def test_a_bias_of_the_whole_is_refused():
    with pytest.raises(ValueError, match="distance_bias of the odometry is 1"):
        OdometrySettings(distance_bias=1.0)
