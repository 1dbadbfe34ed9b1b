"""Distinct walls are counted, not their length."""

import numpy as np
from drawn_maps import RESOLUTION, about_middle, apartment, blank, moved

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.merging.agreement.distinct_walls import distinct_walls
from lidarium.mapping.merging.description.described_map import describe_map

HIT_M = 0.075


def test_walls_are_counted_once_however_long_they_are():
    for length in (60, 120):
        levels = blank(160, 200)
        levels[18 : 22 + length, 18:102] = 0
        levels[20 : 20 + length, 20:100] = 255
        one = describe_map(levels, RESOLUTION)
        assert distinct_walls(one, one, Transform(), HIT_M) == 4


def test_furniture_adds_walls_and_what_lies_elsewhere_none():
    one = describe_map(apartment(), RESOLUTION)
    assert distinct_walls(one, one, Transform(), HIT_M) >= 20
    assert distinct_walls(one, one, Transform(100.0, 0.0), HIT_M) == 0


def test_the_number_of_walls_does_not_depend_on_the_frame():
    truth = about_middle(0.5 * np.pi, apartment())
    one, turned = describe_map(apartment(), RESOLUTION), describe_map(moved(apartment(), truth), RESOLUTION)
    counts = (
        distinct_walls(turned, one, truth, HIT_M),
        distinct_walls(one, one, Transform(), HIT_M),
    )
    assert abs(counts[0] - counts[1]) <= 2
