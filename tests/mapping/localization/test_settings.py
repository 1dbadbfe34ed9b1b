"""All settings of localization in one place."""

import math

import numpy as np
import pytest

from lidarium.mapping.localization.settings import (
    MAX_REACH_M,
    ClosureSettings,
    CompassSettings,
    GraphSettings,
    MatchingSettings,
    OdometryUncertainty,
    SlamSettings,
    SubmapSettings,
)


def test_local_maps_too_large_for_memory_are_refused_with_the_cure():
    submaps = SubmapSettings(resolution=0.01, path_m=60.0)
    with pytest.raises(ValueError, match=r"a local map of 140 m .* want at most 8,192 cells .* coarser"):
        SlamSettings(matching=MatchingSettings(range_m=20.0), submaps=submaps)
    SlamSettings(submaps=SubmapSettings(resolution=0.02, path_m=60.0))


def test_a_range_beyond_any_laser_does_not_make_a_local_map_larger():
    submaps = SubmapSettings(resolution=(MAX_REACH_M + 32.0) / 8192.0 * 1.001)
    assert SlamSettings(matching=MatchingSettings(range_m=900.0), submaps=submaps).matching.range_m == 900.0


def test_a_stage_that_is_none_is_named():
    with pytest.raises(ValueError, match="uses_odometry"):
        SlamSettings(uses_odometry="yes")


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


def test_few_returns_count_less_than_many_but_not_more_than_all():
    matching = MatchingSettings()
    weights = [matching.weight(points) for points in (20, 40, 200, 10_000, 20_000)]
    assert weights[1] == pytest.approx(2 * weights[0])
    assert (
        weights[1]
        < weights[2]
        < weights[3]
        == weights[4]
        == pytest.approx(matching.independent_points / matching.deviation**2)
    )


@pytest.mark.parametrize(
    ("kind", "name", "value"),
    [
        (MatchingSettings, "distance_m", -1.0),
        (MatchingSettings, "points", 0),
        (SubmapSettings, "resolution", 0.0),
        (SubmapSettings, "least_scans", 0),
    ],
)
def test_settings_that_make_no_sense_are_refused_in_matching(kind, name, value):
    with pytest.raises(ValueError, match=f"{name} of {kind.__name__} is"):
        kind(**{name: value})


@pytest.mark.parametrize(
    ("kind", "name", "value"),
    [
        (ClosureSettings, "delay_s", math.nan),
        (ClosureSettings, "search_m", 0.0),
        (GraphSettings, "distance_m", 0.0),
        (GraphSettings, "waiting", 0),
        (CompassSettings, "drift", -1.0),
    ],
)
def test_settings_that_make_no_sense_are_refused_in_graph(kind, name, value):
    with pytest.raises(ValueError, match=f"{name} of {kind.__name__} is"):
        kind(**{name: value})
