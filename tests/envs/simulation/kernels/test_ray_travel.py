"""Rays that travel from free square to free square."""

import math

import numpy as np
import pytest
from cast_rays import (
    FLOORS,
    beams_of,
    check_against_reference,
    directions_of,
    walled,
)

from lidarium.envs.simulation.kernels.ray_casting import cast_in_lanes, cast_one_by_one
from lidarium.envs.simulation.kernels.ray_tables import RayTables
from lidarium.mapping.grids.scan_geometry import ScanGeometry


@pytest.mark.parametrize("kind", FLOORS)
@pytest.mark.parametrize("beams", [32, 33, 48, 63, 121, 720])
@pytest.mark.parametrize("view", [0.3, math.radians(240.0), 2.0 * math.pi])
def test_beams_in_lanes_are_those_cast_one_by_one_to_the_bit(kind, beams, view):
    generator = np.random.default_rng([beams, len(kind)])
    tables = RayTables(FLOORS[kind](generator))
    geometry = ScanGeometry(beams=beams, field_of_view=view)
    free = np.argwhere(tables.squares[0] > 0)
    for reach in (3.0, 40.0, 300.0):
        row, column = generator.choice(free)
        for x, y, heading in [
            (column + generator.random(), row + generator.random(), generator.uniform(-4.0, 4.0)),
            (column + 0.5, row + 0.5, math.pi / 4),
            (float(column), float(row), math.pi / 2),
        ]:
            cast = beams_of(x, y, heading, geometry, directions_of(geometry, heading), reach)
            both = []
            for caster in (cast_in_lanes, cast_one_by_one):
                ranges = np.full(beams, np.nan)
                caster(tables.squares.ravel(), tables.rows, tables.columns, cast, ranges)
                both.append(ranges.tolist())
            assert both[0] == both[1]


@pytest.mark.parametrize("fixed", [0, 1])
def test_a_hall_longer_than_the_largest_square_is_crossed_exactly(fixed):
    solid = walled(12, 1500) if fixed else walled(1500, 12)
    tables = RayTables(solid)
    x, y = (3.5, 6.5) if fixed else (6.5, 3.5)
    heading = 0.001 if fixed else math.pi / 2 + 0.001
    check_against_reference(solid, tables, x, y, heading, ScanGeometry(beams=9, field_of_view=0.01), 5000.0)
