"""Joined pairs that may be wrong all the same say why."""

from dataclasses import replace

import numpy as np
import pytest
from drawn_maps import RESOLUTION, about_middle, apartment, blank, bowed, hall, moved, room

from lidarium.mapping.grids.occupancy import FREE
from lidarium.mapping.merging.merger import Question, doubted, merge_maps
from lidarium.mapping.merging.pair import described
from lidarium.mapping.merging.settings import MergeSettings

SETTINGS = MergeSettings()


def merged(a, b):
    maps = {"a": (a, RESOLUTION), "b": (b, RESOLUTION)}
    return merge_maps(maps, SETTINGS, Question(is_explained=True)).pairs["a", "b"]


def mirrored(levels):
    return np.ascontiguousarray(levels[:, ::-1])


@pytest.fixture(scope="module")
def symmetric():
    """Two rooms in line, the axis through both: no rotation brings them onto themselves, but a mirror does."""
    levels = blank(240, 240)
    room(levels, 20, 20, 90, 190)
    room(levels, 106, 90, 100, 50)
    levels[104:112, 100:130] = FREE
    return levels


@pytest.mark.parametrize("form", [np.copy, mirrored])
def test_a_place_that_is_its_own_mirror_image_is_doubtful(symmetric, form):
    result = merged(symmetric, moved(form(symmetric), about_middle(0.4, symmetric)))
    assert result.is_accepted
    assert result.doubt.startswith("the place is symmetric or a map is mirrored")


def test_an_apartment_and_a_bent_hall_are_not_doubtful():
    for a, b in ((apartment(), moved(apartment(), about_middle(0.9, apartment()))), (hall(), bowed(hall(), 0.3))):
        result = merged(a, b)
        assert result.is_accepted
        assert result.doubt == ""


def test_a_pair_that_another_scale_fits_better_is_doubtful():
    result = merged(hall(), hall())
    bend = replace(result.ranked[0].bend, scale=0.97, bend_m=0.2, growth_m=0.2)
    grown = replace(result, ranked=(result.ranked[0]._replace(bend=bend),))
    maps = [described(hall(), RESOLUTION, SETTINGS)] * 2
    assert "if it grows 0.970 times" in doubted(*maps, grown, SETTINGS).doubt
    refused = replace(grown, is_accepted=False)
    assert doubted(*maps, refused, SETTINGS) is refused
