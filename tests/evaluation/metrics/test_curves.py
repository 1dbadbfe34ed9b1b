import math

import numpy as np
import pytest
from polygon_scans import ring

from lidarium.envs.floors.catalogue.names import load_floor
from lidarium.evaluation.drawing.spline_picture import save_spline_picture
from lidarium.evaluation.metrics.curves import (
    curve_precision,
    distances_to_walls,
    end_point_bytes,
    grid_bytes,
    hits_of_beams,
    seen_walls,
    wall_error,
    wall_recall,
)
from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.grids.scan_geometry import ScanGeometry
from lidarium.mapping.splines.features import observe, scan_points
from lidarium.mapping.splines.spline_map import SplineMap

WALL = np.array([(0.0, 0.0, 4.0, 0.0)])


def line(first, last, y):
    x = np.arange(first, last, 0.01) + 0.005
    return np.stack([x, np.full(len(x), y)], axis=1)


def test_points_are_as_far_from_a_wall_as_from_its_nearest_point():
    distances = distances_to_walls(np.array([(1.0, 0.3), (5.0, 0.0), (-3.0, 4.0)]), WALL)
    np.testing.assert_allclose(distances, (0.3, 1.0, 5.0))


def test_wall_error_is_the_mean_distance_and_its_quantile():
    error = wall_error(np.concatenate([line(0, 3.6, 0.01), line(0, 0.4, 0.2)]), WALL)
    assert error.mean == pytest.approx(0.9 * 0.01 + 0.1 * 0.2)
    assert error.p95 == pytest.approx(0.2)
    assert math.isnan(wall_error(np.empty((0, 2)), WALL).mean)


def test_precision_and_recall_count_what_lies_within_five_centimetres():
    curves = np.concatenate([line(0, 3, 0.04), line(0, 1, 0.06)])
    assert curve_precision(curves, WALL) == pytest.approx(0.75)
    assert wall_recall(line(0, 4, 0.0), curves) == pytest.approx(0.75, abs=0.01)
    assert wall_recall(line(0, 4, 0.0), np.empty((0, 2))) == 0.0
    assert wall_recall(np.empty((0, 2)), curves) == curve_precision(np.empty((0, 2)), WALL) == 1.0


def test_beams_end_at_the_nearest_wall_within_reach():
    walls = np.vstack([ring((-2, -1), (2, -1), (2, 1), (-2, 1)), [(1.0, -0.5, 1.0, 0.5)]])
    hits = hits_of_beams(walls, np.array([(0.0, 0.0, 0.0)]), np.array([0.0, math.pi / 2, math.pi]), 1.5)
    np.testing.assert_allclose(hits, [(1.0, 0.0), (0.0, 1.0)], atol=1e-12)


def test_walls_are_seen_where_beams_end_on_them():
    seen = seen_walls(np.array([(0.0, 0.0, 4.0, 0.0), (0.0, 1.0, 4.0, 1.0)]), line(1.0, 2.0, 0.0))
    assert (seen[:, 1] == 0.0).all()
    assert len(seen) == pytest.approx(55, abs=2)
    assert len(seen_walls(WALL, np.empty((0, 2)))) == 0


def test_sizes_in_bytes():
    assert end_point_bytes(100) == 800
    assert grid_bytes((0.0, 0.0, 1.0, 0.5)) == 200


def test_walls_are_wanted():
    with pytest.raises(ValueError, match="no walls"):
        distances_to_walls(np.zeros((1, 2)), np.empty((0, 4)))


def test_a_map_is_drawn_over_its_floor(tmp_path):
    floor, laser = load_floor("srt_l_room"), ScanGeometry()
    walls = np.concatenate([solid.edges for solid in floor.solids])
    ranges = np.full(laser.beams, np.inf, np.float32)
    ends = hits_of_beams(walls, floor.starts, laser.angles, laser.range_max)
    own = Transform(*map(float, floor.starts[0])).inverse().apply(ends)
    beams = np.rint((np.arctan2(own[:, 1], own[:, 0]) - laser.angle_first) / laser.angle_increment).astype(int)
    ranges[beams] = np.linalg.norm(own, axis=1)
    spline_map = SplineMap()
    spline_map.update(observe(scan_points(ranges, laser)), Transform(*map(float, floor.starts[0])))
    assert wall_error(spline_map.sample(), walls).mean < 0.01
    path = np.array([(0.0, 0.0), (1.0, 1.0)])
    save_spline_picture(tmp_path / "map.png", floor, spline_map, path, path + 0.05, tree=[((0.0, 0.0), (1.0, 1.0))])
    assert (tmp_path / "map.png").read_bytes().startswith(b"\x89PNG")
    save_spline_picture(tmp_path / "blank.png", floor, SplineMap())
    assert (tmp_path / "blank.png").is_file()
