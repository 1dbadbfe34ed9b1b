"""What a body covers of a grid while it drives along a trail."""

from itertools import pairwise

import numpy as np

from lidarium.mapping.planning.footprint_masks import MARGIN_M, footprint_mask, passed

SHAPE, ORIGIN, RESOLUTION, RADIUS = (60, 90), (-1.0, 0.5), 0.05, 0.2
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
    np.testing.assert_allclose(
        (np.mean([columns, rows], axis=1) + 0.5) * RESOLUTION + ORIGIN, TRAIL[0], atol=0.03
    )


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
