"""Batteries are limited where they have a capacity."""

import math

import pytest

from lidarium.envs.settings.battery import BATTERIES, Battery


def test_a_battery_is_limited_where_it_has_a_capacity():
    assert not Battery().is_limited
    assert Battery(capacity_j=1.0).is_limited
    assert not BATTERIES["none"].is_limited


def test_a_kobuki_drives_for_about_as_long_as_its_guide_says():
    kobuki = BATTERIES["kobuki"]
    hours = kobuki.capacity_j / (kobuki.idle_w + 0.33 * kobuki.per_metre_j) / 3600.0
    assert hours == pytest.approx(4.5, rel=0.02)


@pytest.mark.parametrize(("name", "value"), [("capacity_j", 0.0), ("idle_w", -1.0), ("per_metre_j", math.nan)])
def test_what_no_battery_has_is_refused(name, value):
    with pytest.raises(ValueError, match=f"{name} of the battery is {value}"):
        Battery(**{name: value})
