"""All settings of localization in one place."""

import pytest

from lidarium.mapping.localization.matching.settings.matching import MatchingSettings, SubmapSettings
from lidarium.mapping.localization.matching.settings.slam import MOST_REACH_M, SlamSettings


def test_local_maps_too_large_for_memory_are_refused_with_the_cure():
    submaps = SubmapSettings(resolution=0.01, path_m=60.0)
    with pytest.raises(ValueError, match=r"a local map of 140 m .* want at most 8,192 cells .* coarser"):
        SlamSettings(matching=MatchingSettings(range_m=20.0), submaps=submaps)
    SlamSettings(submaps=SubmapSettings(resolution=0.02, path_m=60.0))


def test_a_range_beyond_any_laser_does_not_make_a_local_map_larger():
    submaps = SubmapSettings(resolution=(MOST_REACH_M + 32.0) / 8192.0 * 1.001)
    assert SlamSettings(matching=MatchingSettings(range_m=900.0), submaps=submaps).matching.range_m == 900.0


def test_a_stage_that_is_none_is_named():
    with pytest.raises(ValueError, match="uses_odometry"):
        SlamSettings(uses_odometry="yes")
