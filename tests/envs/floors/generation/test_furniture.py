"""Pieces of furniture as solids with heights."""

import math

import cv2
import numpy as np
import pytest

from lidarium.envs.floors.floor import Floor
from lidarium.envs.floors.generation.furniture import PIECES, place


@pytest.mark.parametrize("kind", PIECES)
def test_furniture_stays_within_its_footprint_and_below_the_ceiling(kind):
    piece = PIECES[kind]
    for width, depth in zip(piece.width, piece.depth, strict=True):
        solids = place(kind, 2.0, 3.0, math.pi / 2, width, depth)
        corners = np.concatenate([solid.polygon for solid in solids])
        assert (np.abs(corners - (2.0, 3.0)).max(axis=0) <= np.array([width, depth]) / 2 + 1e-3).all()
        assert all(0.0 <= solid.z_low < solid.z_high <= 2.0 for solid in solids)


def test_a_laser_sees_the_legs_of_a_table_and_a_tall_body_meets_its_top():
    table = Floor("table", (-2.0, -2.0, 2.0, 2.0), place("table", 0.0, 0.0, math.pi / 2, 1.2, 0.8))
    legs, top = table.raster(0.025, 0.3, 0.3).solid, table.raster(0.025, 0.0, 1.5).solid
    inner = (slice(10, -10), slice(10, -10))
    assert cv2.connectedComponents(legs[inner].copy())[0] - 1 == 4
    assert top[inner].sum() * 0.025**2 == pytest.approx(1.2 * 0.8, rel=0.1)
    assert legs[inner].sum() < 0.05 * top[inner].sum()


def test_furniture_of_an_unknown_kind_is_refused():
    with pytest.raises(ValueError, match="throne"):
        place("throne", 0.0, 0.0, 0.0)


def test_the_back_of_a_piece_is_where_its_direction_points():
    for theta in (0.0, math.pi / 2, math.pi, -math.pi / 2):
        solids = place("bed", 2.0, 3.0, theta, 1.6, 2.0)
        board = next(solid for solid in solids if solid.z_high == 1.0)
        back = board.polygon.mean(axis=0) - (2.0, 3.0)
        assert back @ (math.cos(theta), math.sin(theta)) == pytest.approx(0.97, abs=1e-3)
