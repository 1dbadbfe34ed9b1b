"""Floors as boxes and convex prisms: they cover what is solid, and nothing else."""

import math

import numpy as np
import pytest

from lidarium.envs.floors.floor import Floor, Raster, Solid
from lidarium.envs.simulation.bullet.bodies import FloorShapes


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
