"""Clusters are split into pieces, and pieces merged."""

import math

import numpy as np
import pytest
from scanned_walls import points_of

from lidarium.mapping.splines.breakpoints import clusters
from lidarium.mapping.splines.curves.settings import SegmentationSettings
from lidarium.mapping.splines.segmentation import split_merge


def test_an_l_is_two_lines_that_meet_at_its_corner():
    angle = [(1.5, -1.0, 1.5, 1.0), (1.5, 1.0, -0.5, 1.0)]
    points = points_of(angle, noise=0.005)
    (first, last), *others = clusters(points).tolist()
    cut = split_merge(points.points[first:last], points.sigmas[first:last])
    assert not others
    assert len(cut.pieces) == 2
    assert math.dist(cut.corners[0], (1.5, 1.0)) < 0.02
    turn = cut.lines[1, 2] - cut.lines[0, 2]
    assert math.degrees(abs(math.atan2(math.sin(turn), math.cos(turn)))) == pytest.approx(90.0, abs=1.0)


def test_slopes_find_the_corner_too_except_where_walls_mirror_each_other():
    points = points_of([(1.5, -1.0, 1.5, 1.0), (1.5, 1.0, -0.5, 1.2)])
    first, last = clusters(points)[0]
    by_slope = SegmentationSettings(corner_rule="slope")
    assert len(split_merge(points.points[first:last], points.sigmas[first:last], by_slope).pieces) == 2


@pytest.mark.parametrize("radius", [0.8, 1.0, 1.5])
def test_a_round_wall_is_one_piece(radius):
    angles = np.linspace(0.0, 2.5, 240)
    points = radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    points += 0.005 * np.random.default_rng(0).standard_normal(points.shape)
    assert len(split_merge(points, np.full(240, 0.005)).pieces) == 1


def test_leaves_cover_all_points_in_order():
    generator = np.random.default_rng(4)
    points = np.cumsum(generator.uniform(-0.1, 0.1, (150, 2)), axis=0)
    leaves = split_merge(points).leaves
    assert leaves[0, 0] == 0
    assert leaves[-1, 1] == 149
    assert (leaves[1:, 0] == leaves[:-1, 1]).all()
    assert (leaves[:, 1] > leaves[:, 0]).all()
