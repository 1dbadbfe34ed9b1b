"""Settings of regions are checked, each by its name."""

import dataclasses
import math

import pytest

from lidarium.mapping.merging.regions.settings import RegionSettings


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("cell_m", 0.0),
        ("most_cells", 999),
        ("least_obstacle_m", -0.1),
        ("widest_door_m", math.nan),
        ("door_share", 1.01),
        ("least_area_m2", -1.0),
        ("most_regions", 0),
        ("most_doors", 2.5),
        ("scale_share", 0.0),
        ("scale_steps", -1),
        ("candidates", 1001),
        ("apart_angle", "wide"),
        ("likely_rotations", 3),
    ],
)
def test_a_value_that_makes_no_sense_is_named(name, value):
    with pytest.raises(ValueError, match=name):
        RegionSettings(**{name: value})


def test_the_ends_of_the_bounds_are_allowed():
    ends = {"most_cells": 1000, "door_share": 1.0, "scale_steps": 0, "candidates": 1000, "least_area_m2": 0.0}
    assert dataclasses.asdict(RegionSettings(**ends)).items() >= ends.items()


def test_defaults_hold_and_settings_are_values():
    assert RegionSettings() == RegionSettings()
    assert RegionSettings(most_doors=8) != RegionSettings()
    with pytest.raises(dataclasses.FrozenInstanceError):
        RegionSettings().cell_m = 0.1
