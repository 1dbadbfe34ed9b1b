"""Maps that share their cells are joined exactly, others are not."""

import math

import numpy as np
import pytest
from drawn_maps import RESOLUTION, about_middle, apartment, blank, moved

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.merging.agreement.exact import exact_motion
from lidarium.mapping.merging.description.described_map import describe_map


@pytest.mark.parametrize("quarters", [0, 1, 2, 3])
def test_a_turned_copy_is_laid_on_its_cells_exactly(quarters):
    levels = apartment()
    # Counter-clockwise with row 0 below.
    turned = np.ascontiguousarray(np.rot90(levels, -quarters))
    rows, columns = levels.shape
    corner = ((0.0, 0.0), (rows, 0.0), (columns, rows), (0.0, columns))[quarters]
    truth = Transform(
        corner[0] * RESOLUTION, corner[1] * RESOLUTION, math.remainder(quarters * math.pi / 2.0, math.tau)
    )
    start = Transform(truth.x + 0.12, truth.y - 0.08, truth.theta + math.radians(0.5))
    found = exact_motion(describe_map(turned, RESOLUTION), describe_map(levels, RESOLUTION), start)
    assert found is not None
    assert (found.x, found.y) == pytest.approx((truth.x, truth.y), abs=1e-12)
    assert math.cos(found.theta - truth.theta) == pytest.approx(1.0, abs=1e-12)


def test_a_rotation_that_is_no_quarter_turn_has_no_exact_motion():
    one = describe_map(apartment(), RESOLUTION)
    assert exact_motion(one, one, Transform(theta=math.radians(3.0))) is None


def test_maps_that_do_not_share_their_cells_have_no_exact_motion():
    truth = about_middle(0.02, apartment())
    other = describe_map(moved(apartment(), truth), RESOLUTION)
    assert exact_motion(other, describe_map(apartment(), RESOLUTION), truth) is None
    one = describe_map(apartment(), RESOLUTION)
    assert exact_motion(one, one, Transform(2.0, 0.0, 0.0)) is None


def test_maps_that_know_nothing_in_common_have_no_exact_motion():
    one = describe_map(apartment(), RESOLUTION)
    assert exact_motion(one, one, Transform(100.0, 0.0, 0.0)) is None
    assert exact_motion(one, describe_map(blank(), RESOLUTION), Transform()) is None
    assert exact_motion(describe_map(blank(), RESOLUTION), one, Transform()) is None


def test_walls_that_only_one_map_knows_do_not_count():
    part = apartment()
    part[:, 110:] = 127
    a, b = describe_map(part, RESOLUTION), describe_map(apartment(), RESOLUTION)
    assert exact_motion(a, b, Transform(0.05, 0.0, 0.0)) == Transform()
