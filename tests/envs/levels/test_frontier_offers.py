"""Frontiers are offered and chosen by number."""

import numpy as np
from driven_teams import HALL, ROBOTS, ROOMS, Teams

from lidarium.envs.levels.frontier import REASONS


def test_what_is_not_offered_lets_a_robot_stay():
    teams = Teams((ROOMS,), (1,))
    assert not teams.offers.renew(teams.every, teams.every).any()
    orders = teams.offers.choose(teams.every, np.array([0, 16]))
    assert orders.is_ordered.tolist() == [True, False]
    chosen = teams.offers.target(0)
    assert (chosen.x, chosen.y) == tuple(teams.offers.offers.targets[0, 0])
    assert REASONS[0] == ""


def test_an_episode_begins_without_offers_and_the_others_keep_theirs():
    teams = Teams((ROOMS, HALL), (1, 2))
    teams.offers.renew(teams.every, teams.every)
    counts = teams.offers.offers.counts.copy()
    assert (counts > 0).all()
    teams.offers.choose(teams.every, np.zeros(teams.rows, np.int64))
    teams.offers.start(1)
    assert teams.offers.offers.counts.tolist() == [*counts[:ROBOTS].tolist(), 0, 0]
    assert teams.offers.choices.is_chosen.tolist() == [True, True, False, False]
    assert not teams.offers.observed["action_mask"][ROBOTS:].any()


def test_a_choice_beyond_the_offers_is_none():
    teams = Teams((ROOMS,), (1,))
    teams.offers.renew(teams.every, teams.every)
    count = int(teams.offers.offers.counts[0])
    for number, is_taken in ((count - 1, True), (count, False), (-1, False)):
        orders = teams.offers.choose(teams.every, np.array([number, -1]))
        assert orders.is_ordered.tolist() == [is_taken, False]
