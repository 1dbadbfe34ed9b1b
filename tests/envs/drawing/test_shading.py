"""Faces are shaded as they are seen."""

import math

import numpy as np

from lidarium.envs.drawing.shading import Viewpoint, shade
from lidarium.envs.floors.faces import faces_of, section_of
from lidarium.envs.floors.floor import Floor, Solid

BOX = Solid(np.array([(2.0, 2.0), (3.0, 2.0), (3.0, 3.0), (2.0, 3.0)]), 0.0, 0.8)
WALL = Solid(np.array([(0.0, 0.0), (4.0, 0.0), (4.0, 0.2), (0.0, 0.2)]))
ROOM = Floor("room", (0.0, 0.0, 4.0, 4.0), (WALL, BOX))


def test_a_viewpoint_straight_down_has_an_upright_picture():
    viewpoint = Viewpoint.towards(np.array([2.0, 2.0, 9.0]), np.array([2.0, 2.0, 0.0]), math.radians(60.0))
    picture = shade(section_of(ROOM, 1.3), viewpoint, (200, 200), np.zeros((0, 5)), [], np.array([True, False]))
    ink = (picture == (60, 66, 80)).all(axis=2)
    assert np.nonzero(ink)[0].mean() > 135.0  # the wall at the lowest y is at the bottom
    assert len(faces_of(ROOM)) > 0
