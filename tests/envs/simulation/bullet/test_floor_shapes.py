"""Floors as boxes and convex prisms: they cover what is solid, and nothing else."""

import math

import cv2
import numpy as np
import pytest

from lidarium.envs.floors.floor import Floor, Raster
from lidarium.envs.floors.solid import Solid
from lidarium.envs.simulation.bullet.convex_pieces import convex_pieces
from lidarium.envs.simulation.bullet.floor_shapes import FloorShapes, rectangles


def area(ring):
    x, y = ring.T
    return abs(float(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1)))) / 2.0


@pytest.mark.parametrize("seed", range(20))
def test_pieces_are_convex_and_cover_what_the_outline_does(seed):
    generator = np.random.default_rng(seed)
    angles = np.sort(generator.uniform(0.0, math.tau, 9))
    ring = generator.uniform(0.5, 2.0, 9)[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    hole = 0.05 * np.array([(1, 1), (-1, 1), (-1, -1), (1, -1)]) + 0.0
    holes = (hole,) if seed % 2 else ()
    pieces = convex_pieces(ring, holes)
    for _ in range(200):
        point = generator.uniform(-2.0, 2.0, 2)

        def holds(outline, point=point):
            return cv2.pointPolygonTest((outline * 1e3).astype(np.float32), tuple(point * 1e3), False) > 0

        inside = holds(ring) and not any(map(holds, holes))
        near = abs(cv2.pointPolygonTest((ring * 1e3).astype(np.float32), tuple(point * 1e3), True)) < 1.0
        if not near:
            assert sum(map(holds, pieces)) <= 1
            assert any(map(holds, pieces)) == inside or any(
                abs(cv2.pointPolygonTest((piece * 1e3).astype(np.float32), tuple(point * 1e3), True)) < 1.0
                for piece in pieces
            )
    assert sum(map(area, pieces)) == pytest.approx(_area_of(ring, holes), rel=1e-6)


def _area_of(ring, holes):
    # A star around the origin: its outline does not cross itself.
    return area(ring) - sum(map(area, holes))


@pytest.mark.parametrize("seed", range(5))
def test_rectangles_cover_each_solid_cell_once(seed):
    solid = (np.random.default_rng(seed).random((23, 31)) < 0.6).astype(np.uint8)
    count = np.zeros_like(solid)
    for row, end_row, column, end_column in rectangles(solid):
        count[row:end_row, column:end_column] += 1
    assert np.array_equal(count, solid)


def test_turned_rectangles_are_boxes_and_other_outlines_prisms():
    cosine, sine = math.cos(0.4), math.sin(0.4)
    turned = np.array([(0, 0), (2, 0), (2, 1), (0, 1)]) @ np.array([[cosine, sine], [-sine, cosine]]) + 3.0
    skew = np.array([(6.0, 1.0), (7.0, 1.0), (7.5, 2.0), (6.5, 2.0)])
    floor = Floor("f", (0.0, 0.0, 9.0, 9.0), (Solid(turned, 0.1, 0.4), Solid(skew), Solid(skew, 3.0, 4.0)))
    shapes = FloorShapes.of(floor)
    assert len(shapes.boxes) == 5
    assert shapes.boxes[-1].turn == pytest.approx(0.4)
    assert shapes.boxes[-1].size == pytest.approx((2.0, 1.0, 0.3))
    assert [(low, high) for _, low, high in shapes.prisms] == [(0.0, 2.5)]
    assert shapes.obj.count("\nv ") == 8


def test_cells_of_an_image_become_boxes_as_high_as_the_ceiling():
    solid = np.zeros((4, 5), np.uint8)
    solid[0] = solid[1, 2] = 1
    shapes = FloorShapes.of(Floor("i", (0.0, 0.0, 2.5, 2.0), cells=Raster(solid, (0.0, 0.0), 0.5)))
    assert {box.size for box in shapes.boxes[4:]} == {(2.5, 0.5, 2.5), (0.5, 0.5, 2.5)}
