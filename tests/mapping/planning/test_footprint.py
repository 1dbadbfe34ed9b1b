"""How a round body wants to pass, and what that costs."""

from itertools import pairwise

import numpy as np
import pytest

from lidarium.mapping.planning.clearance import limit_of
from lidarium.mapping.planning.footprint import MARGIN_M, Footprint, footprint_mask, passage_of, passed
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


SHAPE, ORIGIN, RADIUS = (60, 90), (-1.0, 0.5), 0.2
TRAIL = np.array([[0.0, 1.5], [2.0, 1.5], [2.0, 2.5]])


def distances(trail):
    """Distances of the centres of cells from a trail, (rows, columns) [m]."""
    rows, columns = np.indices(SHAPE)
    centres = np.stack([columns + 0.5, rows + 0.5], axis=-1) * RESOLUTION + ORIGIN
    found = np.full(SHAPE, np.inf)
    for a, b in pairwise(trail):
        share = np.clip(((centres - a) @ (b - a)) / ((b - a) @ (b - a)), 0.0, 1.0)
        found = np.minimum(found, np.linalg.norm(centres - a - share[..., None] * (b - a), axis=-1))
    return found


def test_cells_within_body_and_margin_are_covered_to_a_cell():
    mask, away = footprint_mask(SHAPE, ORIGIN, TRAIL, RADIUS, RESOLUTION), distances(TRAIL)
    assert mask[away < RADIUS + MARGIN_M - 1.5 * RESOLUTION].all()
    assert not mask[away > RADIUS + MARGIN_M + 1.5 * RESOLUTION].any()


def test_a_body_that_has_not_moved_covers_a_disc_where_it_stands():
    stand = footprint_mask(SHAPE, ORIGIN, TRAIL[:1], RADIUS, RESOLUTION, 0.0)
    area = stand.sum() * RESOLUTION**2
    assert 0.8 * np.pi * RADIUS**2 < area < 1.5 * np.pi * RADIUS**2
    rows, columns = np.nonzero(stand)
    np.testing.assert_allclose((np.mean([columns, rows], axis=1) + 0.5) * RESOLUTION + ORIGIN, TRAIL[0], atol=0.03)


def test_no_trail_covers_nothing():
    for mask in (footprint_mask, passed):
        assert not mask(SHAPE, ORIGIN, np.empty((0, 2)), RADIUS, RESOLUTION).any()


def test_where_the_body_stands_now_is_not_passed_yet():
    mask, away = passed(SHAPE, ORIGIN, TRAIL, RADIUS, RESOLUTION), distances(TRAIL)
    from_end = distances(np.stack([TRAIL[-1], TRAIL[-1] + 1e-6]))
    reach = RADIUS + MARGIN_M
    assert not mask[from_end < reach - RESOLUTION].any()
    assert mask[(away < RADIUS - 1.5 * RESOLUTION) & (from_end > reach + RESOLUTION)].all()
    assert not mask[away > RADIUS + 1.5 * RESOLUTION].any()


def test_a_trail_beyond_the_grid_is_clipped():
    mask = footprint_mask(SHAPE, ORIGIN, np.array([[-5.0, 1.0], [9.0, 1.0]]), RADIUS, RESOLUTION)
    assert mask[round(0.5 / RESOLUTION)].all()
