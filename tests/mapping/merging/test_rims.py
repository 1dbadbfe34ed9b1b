import math

import numpy as np
import pytest

import lidarium
from lidarium.mapping.files.map_files import read_ros_map
from lidarium.mapping.grids.occupancy import FREE, OCCUPIED, UNKNOWN
from lidarium.mapping.merging.rims import without_rims


def hall(rim):
    levels = np.full((60, 80), UNKNOWN, np.uint8)
    levels[10:50, 10:70] = OCCUPIED
    levels[11:49, 11:69] = UNKNOWN
    levels[11 + rim : 49 - rim, 11 + rim : 69 - rim] = FREE
    levels[20:40, 40:60] = UNKNOWN  # not seen yet
    return levels


@pytest.mark.parametrize("rim", range(5))
def test_free_space_reaches_up_to_the_walls_and_nowhere_else(rim):
    found = without_rims(hall(rim), 0.02)
    filled = found[11:49, 11:69] == FREE
    assert filled[0].all()
    assert filled[:, 0].all()
    assert (found[found != hall(rim)] == FREE).all()
    np.testing.assert_array_equal(found[:10], UNKNOWN)
    assert np.count_nonzero(found[20:40, 40:60] == UNKNOWN) == 400


def test_a_map_whose_walls_border_on_free_space_stays_as_it_is():
    levels = hall(3)
    levels[11:49, 11:14] = levels[11:49, 66:69] = levels[11:14, 11:69] = FREE
    assert without_rims(levels, 0.02) is levels
    # A rim that is wider than 0.15 m is space that was not seen.
    assert without_rims(hall(3), 0.1) is not None
    np.testing.assert_array_equal(without_rims(hall(4), 0.1), hall(4))


def test_maps_with_rims_are_joined_with_themselves_and_with_the_one_without(shared_cases):
    maps = [read_ros_map(shared_cases / "walls-behind-a-rim-of-unknown" / f"rim_{rim}.yaml").levels for rim in range(5)]
    for rim in range(1, 5):
        for first in (0, rim):
            merged = lidarium.merge_maps({"a": (maps[first], 0.02), "b": (maps[rim], 0.02)})
            (pair,) = merged.pairs.values()
            assert pair.is_accepted
            assert pair.agreement.agreeing_m > 20.0
            assert math.hypot(pair.a_from_b.x, pair.a_from_b.y) < 0.02
            assert abs(pair.a_from_b.theta) < math.radians(0.1)
