"""Clusters of a scan break where surfaces end."""

import numpy as np
import pytest
from scanned_walls import LASER, points_of

from lidarium.mapping.splines.breakpoints import clusters
from lidarium.mapping.splines.curves.settings import SegmentationSettings
from lidarium.mapping.splines.scan_points import scan_points


@pytest.mark.parametrize("test", ["adaptive", "dietmayer", "pedraza"])
def test_two_walls_with_a_gap_are_two_clusters(test):
    points = points_of([(2.0, -1.0, 2.0, -0.2), (2.0, 0.2, 2.0, 1.0)])
    assert len(clusters(points, SegmentationSettings(test=test))) == 2


@pytest.mark.parametrize("test", ["adaptive", "dietmayer", "pedraza"])
def test_a_wall_behind_another_is_a_cluster_of_its_own(test):
    points = points_of([(1.5, -1.0, 1.5, 0.0), (2.5, -0.5, 2.5, 1.0)])
    assert len(clusters(points, SegmentationSettings(test=test))) == 2


def test_a_slanted_wall_is_one_surface_to_the_adaptive_test_only():
    slanted = [(0.5, -0.4, 5.0, -0.9)]
    assert len(clusters(points_of(slanted))) == 1
    direct = SegmentationSettings(test="dietmayer", dietmayer_floor=0.01, dietmayer_share=0.005)
    first, last = clusters(points_of(slanted), direct)[0]
    assert last - first < len(points_of(slanted).points)


def test_invalid_beams_and_beams_without_a_return_break():
    ranges = np.full(LASER.beams, 2.0, np.float32)
    ranges[300], ranges[500] = np.nan, np.inf
    assert clusters(scan_points(ranges, LASER)).tolist() == [[0, 300], [300, 499], [499, 725]]


def test_small_clusters_are_left_out():
    ranges = np.full(LASER.beams, np.inf, np.float32)
    ranges[[10, 11, 12]] = 1.0
    ranges[100:104] = 1.0
    assert len(clusters(scan_points(ranges, LASER))) == 1
