"""What kernels look up for a floor."""

import copy

import numpy as np
import pytest

from lidarium.envs.floors.floor import Floor, Solid
from lidarium.envs.simulation.kernels.floor_cache import FloorTables

TABLE = Solid(np.array([(1.0, 1.0), (2.0, 1.0), (2.0, 2.0), (1.0, 2.0)]), 0.7, 0.75)
WALL = Solid(np.array([(3.0, 0.0), (3.2, 0.0), (3.2, 2.0), (3.0, 2.0)]))


def tables_of(*solids):
    return FloorTables.of_floor(Floor("room", (0.0, 0.0, 4.0, 3.0), solids), 0.05, 0.3, 1.0)


def test_a_body_meets_what_the_laser_misses():
    tables = tables_of(TABLE, WALL)
    assert tables.laser is not tables.body
    only = (tables.body.solid != 0) & (tables.laser.solid == 0)
    assert only.sum() * 0.05**2 == pytest.approx(1.0, rel=0.02)


@pytest.mark.parametrize("solids", [(WALL,), (TABLE, WALL)])
def test_tables_that_were_packed_are_the_same(solids):
    tables = tables_of(*solids)
    again = FloorTables.unpacked(tables.packed(), tables.floor)
    for name in ("laser", "body"):
        one, other = getattr(tables, name), getattr(again, name)
        assert np.array_equal(one.solid, other.solid)
        assert (one.origin, one.resolution) == (other.origin, other.resolution)
    assert np.array_equal(tables.bound, again.bound)
    assert np.array_equal(tables.rays.squares, again.rays.squares)
    assert (again.laser is again.body) == (tables.laser is tables.body)


def test_episodes_share_tables_and_none_can_write_to_them():
    tables = tables_of(WALL)
    assert tables.laser is tables.body
    assert copy.deepcopy(tables) is tables
    with pytest.raises(ValueError, match="read-only"):
        tables.body.solid[0, 0] = 0
    assert tables.frame.tolist() == [*tables.laser.origin, 0.05]
    assert tables.row.shape == (10,)
    assert tables.nbytes > tables.body.solid.nbytes


def test_rasters_alone_have_no_faces_for_cameras():
    tables = tables_of(WALL)
    alone = FloorTables(tables.laser, tables.body, tables.rays, tables.bound)
    with pytest.raises(ValueError, match="these tables know no floor"):
        assert alone.faces
