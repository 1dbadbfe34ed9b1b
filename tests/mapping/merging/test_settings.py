"""Settings of merging and their two modes."""

import pytest

from lidarium.mapping.merging.agreement import ValidationSettings
from lidarium.mapping.merging.settings import MergeSettings, merge_settings


def test_unknown_modes_and_settings_are_named():
    with pytest.raises(ValueError, match="mode"):
        merge_settings("printed")
    with pytest.raises(ValueError, match="cycle_distance_m"):
        MergeSettings(cycle_distance_m=0.0)
    with pytest.raises(ValueError, match="hit_rate"):
        ValidationSettings(hit_rate=2.0)


def test_the_thesis_counts_in_cells_and_the_default_in_metres():
    fine, coarse = merge_settings("thesis", 0.025), merge_settings("thesis", 0.1)
    assert coarse.descriptors.radius_max == pytest.approx(4.0 * fine.descriptors.radius_max)
    assert coarse.descriptors.radius_max == pytest.approx(25 * 0.1)
    assert fine.corners == coarse.corners
    assert merge_settings("default", 0.025) == merge_settings("default", 0.1) == MergeSettings()


def test_the_thesis_joins_no_bent_maps_and_tries_no_other_rotations():
    thesis = merge_settings("thesis")
    assert thesis.confidence > 1.0
    assert thesis.correlation.rotations == 0
    assert MergeSettings().confidence <= 1.0
