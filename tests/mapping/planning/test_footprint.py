"""How a round body wants to pass, and what that costs."""

import numpy as np
import pytest

from lidarium.mapping.planning.clearance import limit_of
from lidarium.mapping.planning.footprint import Footprint, passage_of
from lidarium.mapping.planning.search.search_state import DIAGONAL, STRAIGHT

RESOLUTION = 0.05
LIMIT = limit_of(0.6, RESOLUTION)


@pytest.mark.parametrize("values", [(-0.1, 0.3, 1.0), (0.4, 0.3, 1.0), (0.1, 0.3, -1.0), (0.1, 0.3, 1001.0)])
def test_bodies_that_make_no_sense_are_refused(values):
    with pytest.raises(ValueError, match="want"):
        Footprint(*values)


def test_steps_cost_their_length_where_there_is_room_and_more_towards_the_least_clearance():
    footprint = Footprint(0.1, 0.3, 3.0)
    passage = passage_of(footprint, RESOLUTION, LIMIT)
    clearance = 0.5 * RESOLUTION * np.sqrt(LIMIT - np.arange(LIMIT + 1))
    fits = clearance >= 0.1 - 1e-9
    straight, diagonal = passage.half_costs
    assert (straight[~fits] == 0).all()
    assert (straight[fits] > 0).all()
    roomy = clearance >= 0.3 - 1e-9
    np.testing.assert_array_equal(straight[roomy], STRAIGHT // 2)
    np.testing.assert_array_equal(diagonal[roomy], DIAGONAL // 2)
    expected = STRAIGHT / 2 * (1.0 + 3.0 * ((0.3 - clearance) / 0.2) ** 2)
    tight = fits & ~roomy
    np.testing.assert_allclose(straight[tight], expected[tight], atol=1.0)
    # Closeness grows towards walls: costs never fall.
    assert (np.diff(straight[fits]) >= 0).all()


def test_a_body_of_no_size_does_not_pass_through_what_is_occupied():
    costs = passage_of(Footprint(0.0, 0.2, 1.0), RESOLUTION, LIMIT).half_costs
    assert (costs[:, LIMIT] == 0).all()
    assert (costs[:, : LIMIT - 1] > 0).all()


def test_lengths_are_in_cells_and_costs_cannot_be_changed():
    passage = passage_of(Footprint(0.1, 0.3), RESOLUTION, LIMIT)
    assert (passage.radius, passage.preferred) == pytest.approx((2.0, 6.0))
    with pytest.raises(ValueError, match="read-only"):
        passage.half_costs[0, 0] = 1


def test_more_clearance_than_the_field_knows_is_refused():
    with pytest.raises(ValueError, match=r"preferred clearance 0.9 m is beyond"):
        passage_of(Footprint(0.1, 0.9), RESOLUTION, LIMIT)
