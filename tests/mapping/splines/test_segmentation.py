"""Clusters are split into pieces, and pieces merged."""

import math
from itertools import pairwise

import numpy as np
import pytest
from scanned_walls import points_of

from lidarium.mapping.splines.features import clusters
from lidarium.mapping.splines.segmentation import _fit_line, _merge_runs, _split_runs, split_merge
from lidarium.mapping.splines.settings import SegmentationSettings


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


def polyline(*corners, step=0.05):
    parts = []
    for a, b in pairwise(corners):
        count = round(math.dist(a, b) / step)
        share = np.arange(count)[:, None] / count
        parts.append(np.array(a) * (1.0 - share) + np.array(b) * share)
    return np.concatenate([*parts, [corners[-1]]])


@pytest.mark.parametrize("angle", [0.0, 0.7, 2.0, math.pi, -2.5, -math.pi / 2.0])
def test_a_line_runs_as_its_points_do_and_noise_is_its_rms(angle):
    along = np.array([math.cos(angle), math.sin(angle)])
    points = np.array([1.0, 2.0]) + np.linspace(-1.0, 1.0, 41)[:, None] * along
    x, y, theta, half, rms = _fit_line(points, 0, 40)
    assert (x, y, half, rms) == pytest.approx((1.0, 2.0, 1.0, 0.0), abs=1e-9)
    assert abs(math.remainder(theta - angle, math.tau)) < 1e-9
    aside = 0.02 * np.where(np.arange(41) % 2, 1.0, -1.0)[:, None] * np.array([-along[1], along[0]])
    assert _fit_line(points + aside, 0, 40)[4] == pytest.approx(0.02, rel=0.05)


def test_only_the_points_of_the_run_count():
    points = polyline((0.0, 0.0), (2.0, 0.0), (2.0, 2.0))
    assert _fit_line(points, 0, 40)[:4] == pytest.approx((1.0, 0.0, 0.0, 1.0))
    assert _fit_line(points, 40, 80)[:4] == pytest.approx((2.0, 1.0, math.pi / 2.0, 1.0))


def split(points, limit=0.05, sigma=0.0):
    ends = np.empty(len(points) + 1, np.int64)
    count = _split_runs(points, np.full(len(points), sigma), limit, 3.0, ends)
    return ends[: count + 1].tolist()


def test_runs_are_split_at_corners_and_cover_all_points():
    assert split(polyline((0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (1.0, 3.0))) == [0, 40, 80, 108]
    assert split(polyline((0.0, 0.0), (3.0, 1.0))) == [0, 63]


def test_bends_within_the_noise_are_not_split():
    bent = polyline((0.0, 0.0), (1.0, 0.1), (2.0, 0.0))
    assert len(split(bent)) == 3
    assert len(split(bent, sigma=0.04)) == 2


def test_neighbours_of_one_line_are_merged_and_others_are_not():
    points = polyline((0.0, 0.0), (2.0, 0.0), (2.0, 2.0))
    ends = np.array([0, 15, 40, 80, 0, 0], np.int64)
    count = _merge_runs(points, np.zeros(len(points)), 0.05, 3.0, math.radians(10.0), ends, 3)
    assert ends[: count + 1].tolist() == [0, 40, 80]
    same = ends.copy()
    assert _merge_runs(points, np.zeros(len(points)), 0.05, 3.0, math.radians(10.0), same, 2) == 2
