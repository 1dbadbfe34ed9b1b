"""A spline map over the true floor."""

import numpy as np
from matplotlib.figure import Figure

from lidarium.evaluation.drawing.spline_picture import _draw_map, _draw_paths, _draw_tree
from lidarium.mapping.splines.landmarks import Landmarks
from lidarium.mapping.splines.spline_map import SplineMap


def test_points_that_few_scans_have_seen_are_not_shown():
    spline_map = SplineMap()
    points, counts = np.array([(0.0, 0.0), (1.0, 1.0), (2.0, 2.0)]), np.array([2, 3, 9])
    spline_map.corners = Landmarks(points, np.ones(3), counts, np.zeros(3, np.int64))
    axes = Figure().subplots()
    labels = [entry.get_label() for entry in _draw_map(axes, spline_map)]
    assert labels == ["curves and control points", "corners", "peaks"]
    corners, peaks = axes.lines
    assert list(corners.get_xdata()) == [1.0, 2.0]
    assert list(peaks.get_xdata()) == []


def test_paths_and_trees_that_are_given_are_in_the_legend():
    axes, path = Figure().subplots(), np.array([(0.0, 0.0, 9.0), (1.0, 2.0, 9.0)])
    assert _draw_paths(axes, None, None) == []
    assert [line.get_label() for line in _draw_paths(axes, path, path)] == ["true path", "believed path"]
    assert list(axes.lines[0].get_ydata()) == [0.0, 2.0]
    assert _draw_tree(axes, [((0.0, 0.0), (1.0, 1.0))], [path[:, :2]]).get_label() == "tree"
    assert list(axes.lines[-1].get_xdata()) == [0.0, 1.0]
