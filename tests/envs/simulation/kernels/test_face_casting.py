"""Scans by drawing the faces of walls into the beams."""

import math

import numpy as np
from cast_rays import (
    all_casts,
    beams_of,
    by_faces,
    directions_of,
    free_position,
    turned,
    walled,
)

from lidarium.envs.simulation.kernels.face_casting import FaceTable, cast_by_faces
from lidarium.envs.simulation.kernels.ray_tables import RayTables
from lidarium.mapping.grids.scan_geometry import ScanGeometry


def test_the_casters_agree_with_each_other_on_real_sizes():
    generator = np.random.default_rng(5)
    solid = turned(generator, 400, 500)
    tables = RayTables(solid)
    geometry = ScanGeometry()
    for _ in range(20):
        x, y = free_position(solid, generator)
        _, (squares, faces, chosen) = all_casts(tables, x, y, generator.uniform(-math.pi, math.pi), geometry, 224.0)
        assert np.abs(squares - faces).max() < 1e-6
        assert np.abs(squares - chosen).max() < 1e-6


def test_faces_of_tiles_beyond_the_window_are_not_drawn():
    solid = walled(300, 300)
    tables, geometry = RayTables(solid), ScanGeometry(beams=64, field_of_view=2.0 * math.pi)
    beams = beams_of(64.5, 64.5, 0.1, geometry, directions_of(geometry, 0.1), 1000.0)
    near, whole = np.full(64, np.nan), by_faces(tables, beams)
    table = FaceTable(tables.faces, tables.face_starts, tables.tile_columns)
    cast_by_faces(table, (0, 0, 0, 0), beams, near)
    assert (near >= whole - 1e-9).all()
    assert (near == 1000.0).any()
    assert (np.abs(near - whole) < 1e-9).any()
