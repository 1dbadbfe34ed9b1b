"""Packed floors come back to the bit."""

import numpy as np
import pytest

from lidarium.envs.floors.catalogue.names import load_floor
from lidarium.envs.floors.floor import Floor, Raster, Solid
from lidarium.envs.floors.generation.buildings import generate_building
from lidarium.envs.floors.generation.packing import packed_floor, unpacked_floor

SQUARE = np.array([(1.0, 1.0), (3.0, 1.0), (3.0, 3.0 + 1e-13), (1.0, 3.0)])


def with_holes_and_goal():
    solids = (Solid(SQUARE, 0.1, 2.0, (SQUARE / 4 + 1.2, SQUARE[:3] / 5 + 2.0)), Solid(SQUARE[:3] + 4.0))
    return Floor("größer", (0.0, -1.0, 8.0, 9.5), solids, starts=np.array([(0.5, 0.5, 0.1)]), goal=(7.0, 8.0))


@pytest.mark.parametrize(
    "floor",
    [
        generate_building(3),
        load_floor("apartment"),
        with_holes_and_goal(),
        Floor("empty", (0.0, 0.0, 1.0, 1.0)),
    ],
    ids=lambda floor: floor.name,
)
def test_a_floor_comes_back_to_the_bit(floor):
    back = unpacked_floor(packed_floor(floor))
    assert (back.name, back.bounds, back.goal) == (floor.name, floor.bounds, floor.goal)
    assert np.array_equal(back.starts, floor.starts)
    assert len(back.solids) == len(floor.solids)
    for one, other in zip(back.solids, floor.solids, strict=True):
        assert (one.z_low, one.z_high) == (other.z_low, other.z_high)
        assert np.array_equal(one.polygon, other.polygon)
        assert len(one.holes) == len(other.holes)
        assert all(map(np.array_equal, one.holes, other.holes))
    assert back.sha256 == floor.sha256
    assert back.geometry_sha256 == floor.geometry_sha256


def test_a_floor_of_cells_is_refused():
    cells = Raster(np.ones((3, 3), np.uint8), (0.0, 0.0), 0.1)
    with pytest.raises(ValueError, match="made of cells"):
        packed_floor(Floor("image", (0.0, 0.0, 0.3, 0.3), cells=cells))
