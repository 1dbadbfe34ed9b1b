"""Frontiers are offered by the cost of their paths, and given up where a robot gets nowhere."""

import numpy as np
import pytest
from driven_teams import HALL, ROBOTS, ROOMS, Teams

from lidarium.envs.levels.frontier_choices import BLOCKED, MOVED, NO_PROGRESS, PATIENCE_S, UNSEEN
from lidarium.envs.onboard.driving.path_following import ARRIVED
from lidarium.envs.onboard.driving.path_planner import footprint_of
from lidarium.mapping.planning.grid_planning import search

NOBODY = np.zeros(ROBOTS, np.bool_)


@pytest.fixture
def teams():
    made = Teams((ROOMS,), (1,))
    made.offers.renew(made.every, made.every)
    return made


def chosen(teams):
    """Let the first robot choose its first offer, the other stay."""
    orders = teams.offers.choose(teams.every, np.array([0, -1]))
    teams.driver.assign(teams.every, orders)
    teams.driver.prepare()
    return teams.offers.offers.cells[0, 0].copy()


def renewed(teams, seconds=0.0):
    teams.simulation.world.steps += round(seconds / teams.settings.time_step)
    return teams.offers.renew(teams.every, teams.every).tolist()


def test_offers_are_places_by_the_cost_of_their_paths_with_a_frontier_in_reach(teams):
    offers, navigation = teams.offers.offers, teams.perception.planning_map(0, True)
    footprint = footprint_of(teams.settings.robot.radius)
    for row in range(ROBOTS):
        count = offers.counts[row]
        table, places = offers.tables[row, :count], offers.targets[row, :count] + teams.offsets[row]
        assert 1 <= count <= teams.settings.frontiers
        assert (np.diff(table[:, 2]) >= 0.0).all()
        start = teams.driver.planner.cell(row)
        found = search(navigation.space, navigation.log_odds, navigation.clearance, start, footprint)
        low, resolution = np.array(teams.driver.planner.origin(row)), navigation.resolution
        for k, place in enumerate(places):
            cell = tuple(np.floor((place - low)[::-1] / resolution).astype(int).tolist())
            assert table[k, 2] == pytest.approx(found.cost(cell), rel=1e-5, abs=1e-6)
            assert table[k, :2] == pytest.approx(place - teams.simulation.beliefs.believed[row, :2], abs=1e-6)
            rise, run = offers.cells[row, k] - cell
            assert offers.headings[row, k] == pytest.approx(np.arctan2(rise, run))
            assert navigation.frontiers.flags[tuple(offers.cells[row, k])]
            assert table[k, 3] >= min(teams.settings.least_frontier, table[:, 3].max()) - 1e-6


def test_what_is_not_offered_is_zero_and_to_stay_may_always_be_chosen(teams):
    offers = teams.offers.offers
    for row in range(ROBOTS):
        count = offers.counts[row]
        assert not offers.tables[row, count:].any()
        assert offers.masks[row].tolist() == [1] * count + [0] * (teams.settings.frontiers - count) + [1]


def test_nobody_is_offered_anything_where_all_is_known():
    teams = Teams((ROOMS,), (1,))
    for log_odds in teams.simulation.beliefs.log_odds:
        log_odds[:] = -20
    teams.simulation.beliefs.windows[:] = (0, log_odds.shape[0], 0, log_odds.shape[1])
    teams.perception.start(None, 0)
    assert not teams.offers.renew(teams.every, teams.every).any()
    assert not teams.offers.offers.counts.any()
    assert (teams.offers.offers.masks[:, -1] == 1).all()


@pytest.mark.parametrize(
    ("has_path", "state", "reason"), [(True, ARRIVED, UNSEEN), (False, 0, BLOCKED), (True, None, 0)]
)
def test_what_is_reached_or_cannot_be_is_given_up_and_not_offered_again(teams, has_path, state, reason):
    cell, drives = chosen(teams), teams.driver.drives
    drives.has_path[0] = has_path
    if state is not None:
        drives.states[0] = state
    assert renewed(teams) == [reason, 0]
    offers = teams.offers.offers
    is_offered = (offers.cells[0, : offers.counts[0]] == cell).all(axis=1).any()
    assert is_offered == (reason == 0)


def test_patience_lasts_as_long_as_the_robot_moves(teams):
    chosen(teams)
    assert renewed(teams) == [0, 0]
    assert renewed(teams, PATIENCE_S) == [0, 0]
    teams.simulation.beliefs.believed[0, 0] += 1.1 * MOVED
    assert renewed(teams, 1.0) == [0, 0]
    teams.simulation.beliefs.believed[0, 0] += 0.9 * MOVED
    assert renewed(teams, PATIENCE_S) == [0, 0]
    assert renewed(teams, 0.1) == [NO_PROGRESS, 0]


def test_only_live_robots_give_up_and_only_those_asked_for_are_offered():
    teams = Teams((ROOMS, HALL), (1, 2))
    is_offered = np.array([True, False, False, True])
    assert not teams.offers.renew(teams.every, is_offered).any()
    assert (teams.offers.offers.counts > 0).tolist() == is_offered.tolist()
    teams.offers.choose(teams.every, np.array([0, -1, -1, 0]))
    teams.driver.drives.is_ordered[:] = True
    live = np.array([True, True, True, False])
    assert teams.offers.renew(live, np.zeros(4, np.bool_)).tolist() == [BLOCKED, 0, 0, 0]
