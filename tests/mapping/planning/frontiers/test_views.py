"""Views of frontiers: what they show against plain rays, and that corners are looked behind."""

import math

import numpy as np
import pytest

from lidarium.agents.tours.planning import Tourist, TourRequest, TourSettings, memory_of, tour_options
from lidarium.envs.onboard.navigation import NavigationMap
from lidarium.mapping.planning.frontiers.views import RAYS, ViewRules, gain_at

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
    return log_odds


def views_from(log_odds, cell):
    """Return the map's frontiers and the views of those that a robot in a cell can see."""
    navigation, tours = NavigationMap(log_odds, RESOLUTION), TourSettings(least_gain=0.0)
    navigation.changed((0, log_odds.shape[0], 0, log_odds.shape[1]))
    clusters = navigation.frontiers.clusters(minimum_cells=6)
    robot = Tourist(np.array([(cell[1] + 0.5) * RESOLUTION, (cell[0] + 0.5) * RESOLUTION, 0.0]))
    request = TourRequest(navigation, clusters, [robot], memory_of(navigation, tours))
    return clusters, tour_options([request], 0.18, tours, ViewRules())[0]


@pytest.mark.parametrize("cell", [(40, 20), (40, 70), (20, 50)])
@pytest.mark.parametrize("rules", [ViewRules(), ViewRules(reach=2.0, depth=0.4)])
def test_a_view_shows_what_rays_cross(cell, rules):
    log_odds = two_rooms()
    assert gain_at(log_odds, RESOLUTION, cell, rules)[0] == pytest.approx(gain_by_rays(log_odds, cell, rules))


def test_views_show_more_than_places_beside_the_jambs():
    log_odds, rules = two_rooms(), ViewRules()
    clusters, views = views_from(log_odds, (40, 20))
    assert len(clusters) == len(views.gains) == 2
    for k in range(2):
        row, column = (views.places[k] * views.grid.factor + views.grid.factor // 2).tolist()
        middle = views.grid.row + row, views.grid.column + column
        assert gain_at(log_odds, RESOLUTION, middle, rules)[0] == pytest.approx(views.gains[k])
        cells = views.cells_of(k)
        beside = tuple(int(value) for value in cells[np.argmin(cells[:, 1])])
        assert views.gains[k] > 1.2 * gain_at(log_odds, RESOLUTION, (beside[0], 55), rules)[0]


def test_the_direction_is_that_of_what_is_unknown():
    log_odds = np.full((60, 60), -20, np.int8)
    log_odds[:, 40:] = 0
    gain, direction = gain_at(log_odds, RESOLUTION, (30, 20), ViewRules())
    assert gain > 1.0
    assert abs(direction) < 0.05


def test_a_frontier_out_of_reach_has_no_view():
    log_odds = two_rooms()
    log_odds[30:50, 60] = 20
    clusters, views = views_from(log_odds, (40, 20))
    assert (clusters.centroids[:, 0] > 60 * RESOLUTION).any()
    assert views is None or (clusters.centroids[views.numbers, 0] <= 60 * RESOLUTION).all()
