"""Scales at which one map may lie on another."""

import math
from dataclasses import replace

import numpy as np
import pytest
from drawn_maps import RESOLUTION, about_middle, apartment, moved

from lidarium.mapping.grids.occupancy import OCCUPIED
from lidarium.mapping.merging.description.described_map import describe_map
from lidarium.mapping.merging.scaling.scale_search import ScaleSettings, grown_levels, placements, wall_axis

QUICK = ScaleSettings(slants=0, candidates=8)


def test_the_axis_of_walls_is_that_of_the_turned_map():
    for theta in (0.0, 0.3, -0.6):
        turned = moved(apartment(), about_middle(theta, apartment()))
        described = describe_map(turned, RESOLUTION)
        assert math.remainder(wall_axis(described) - theta, math.pi / 2.0) == pytest.approx(0.0, abs=0.03)


def test_placements_hold_the_true_one_first():
    floor, scale = apartment(), 1.3
    there = about_middle(-0.4, floor, (400, 400))
    plan = grown_levels(moved(floor, there, (400, 400)), RESOLUTION / scale, RESOLUTION)
    best = placements(describe_map(floor, RESOLUTION), describe_map(plan, RESOLUTION), QUICK)[0]
    assert best.scale == pytest.approx(scale, rel=0.04)
    distance, angle = best.a_from_b.difference(there.inverse(), (10.0, 10.0))
    assert distance < 0.6
    assert angle < math.radians(3.0)


@pytest.mark.parametrize("scale", [0.4, 1.0, 2.5])
def test_walls_stay_where_they_are_when_cells_change(scale):
    levels = grown_levels(apartment(), RESOLUTION * scale, RESOLUTION)
    rows, columns = np.nonzero(apartment() == OCCUPIED)
    x, y = (columns + 0.5) * scale, (rows + 0.5) * scale
    inside = (y < levels.shape[0]) & (x < levels.shape[1])
    assert (levels[y[inside].astype(int), x[inside].astype(int)] == OCCUPIED).mean() > 0.99


@pytest.mark.parametrize(
    "wrong", [{"least": 0.0}, {"most": 0.5}, {"step": 0.0}, {"candidates": 0}, {"confidence": 2.0}]
)
def test_settings_that_make_no_sense_are_refused(wrong):
    with pytest.raises(ValueError, match="want"):
        replace(QUICK, **wrong)


def test_scales_are_a_ladder_from_the_least_to_the_most():
    scales = ScaleSettings(least=0.5, most=2.0, step=0.1).scales
    assert scales[0] == 0.5
    assert 1.8 < scales[-1] <= 2.0
    np.testing.assert_allclose(np.diff(np.log(scales)), 0.1)
