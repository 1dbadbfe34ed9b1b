"""Views of frontiers: what they show against plain rays, and that corners are looked behind."""

import math

import numpy as np
import pytest

from lidarium.mapping.planning.clearance import ClearanceField
from lidarium.mapping.planning.frontiers.frontier_map import FrontierMap
from lidarium.mapping.planning.frontiers.views import RAYS, ViewRules, gain_at, views_of
from lidarium.mapping.planning.touring.coarse_distances import coarse_grid, distances_from

RESOLUTION = 0.05


def gain_by_rays(log_odds, cell, rules):
    """Return the unknown area in view, written plainly."""
    area = 0.0
    for k in range(RAYS):
        angle = (k + 0.5) * 2.0 * math.pi / RAYS
        unknown = 0
        for step in range(1, round(rules.reach / RESOLUTION) + 1):
            row = math.floor(cell[0] + 0.5 + step * math.sin(angle))
            column = math.floor(cell[1] + 0.5 + step * math.cos(angle))
            if not (0 <= row < log_odds.shape[0] and 0 <= column < log_odds.shape[1]):
                break
            if log_odds[row, column] > 0:
                break
            if log_odds[row, column] == 0:
                area += step * 2.0 * math.pi / RAYS
                unknown += 1
                if unknown >= round(rules.depth / RESOLUTION):
                    break
    return area * RESOLUTION**2


def two_rooms():
    """Return a room seen from within, and one behind a door of which a wedge was seen.

    The wall is at column 60, the door in rows 30 to 49; the wedge ends at the jambs.
    """
    log_odds = np.zeros((80, 140), np.int8)
    log_odds[5:75, 5:60] = -20
    log_odds[4, 4:121] = log_odds[75, 4:121] = log_odds[4:76, 4] = 20
    log_odds[4:30, 60] = log_odds[50:76, 60] = 20
    for column in range(60, 120):
        spread = (column - 60) // 4
        log_odds[30 - min(spread, 20) : 50 + min(spread, 20), column] = -20
    log_odds[4:76, 120] = 20
    field = ClearanceField(log_odds.shape, RESOLUTION, 0.6)
    field.update(log_odds)
    frontiers = FrontierMap(log_odds.shape, RESOLUTION)
    frontiers.update(log_odds)
    return log_odds, field, frontiers


@pytest.mark.parametrize("cell", [(40, 20), (40, 70), (20, 50)])
@pytest.mark.parametrize("rules", [ViewRules(), ViewRules(reach=2.0, depth=0.4)])
def test_a_view_shows_what_rays_cross(cell, rules):
    log_odds, _, _ = two_rooms()
    assert gain_at(log_odds, RESOLUTION, cell, rules)[0] == pytest.approx(gain_by_rays(log_odds, cell, rules))


def test_views_show_more_than_places_beside_the_jambs():
    log_odds, field, frontiers = two_rooms()
    grid = coarse_grid(log_odds, field, 0.18)
    lengths = distances_from(grid, np.array([grid.cell_of((40, 20))]))[0]
    clusters = frontiers.clusters(minimum_cells=6)
    rules = ViewRules()
    views = views_of(log_odds, RESOLUTION, grid, lengths, (clusters.cells, clusters.starts), rules)
    assert len(clusters) == len(views.gains) == 2
    for k in range(2):
        row, column = views.cells[k]
        assert lengths[row, column] == views.lengths[k]
        middle = (
            grid.row + int(row) * grid.factor + grid.factor // 2,
            grid.column + int(column) * grid.factor + grid.factor // 2,
        )
        assert gain_at(log_odds, RESOLUTION, middle, rules)[0] == pytest.approx(views.gains[k])
        beside = tuple(int(value) for value in clusters.of(k)[np.argmin(clusters.of(k)[:, 1])])
        assert views.gains[k] > 1.2 * gain_at(log_odds, RESOLUTION, (beside[0], 55), rules)[0]


def test_the_direction_is_that_of_what_is_unknown():
    log_odds = np.full((60, 60), -20, np.int8)
    log_odds[:, 40:] = 0
    gain, direction = gain_at(log_odds, RESOLUTION, (30, 20), ViewRules())
    assert gain > 1.0
    assert abs(direction) < 0.05


def test_a_frontier_out_of_reach_has_no_view():
    log_odds, field, frontiers = two_rooms()
    log_odds[30:50, 60] = 20
    field.update(log_odds)
    frontiers.update(log_odds)
    grid = coarse_grid(log_odds, field, 0.18)
    lengths = distances_from(grid, np.array([grid.cell_of((40, 20))]))[0]
    clusters = frontiers.clusters(minimum_cells=6)
    views = views_of(log_odds, RESOLUTION, grid, lengths, (clusters.cells, clusters.starts), ViewRules())
    beyond = clusters.centroids[:, 0] > 60 * RESOLUTION
    assert beyond.any()
    assert (views.cells[beyond] == -1).all()
    assert (views.gains[beyond] == 0.0).all()
