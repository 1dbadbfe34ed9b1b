"""A station's joins make groups of robots, each by the pair that joined two groups."""

from lidarium.agents.report import Join, PolicyReport, Supervision
from lidarium.evaluation.episodes.supervision import joined_groups
from lidarium.mapping.geometry.rigid import Transform

AGENTS = [f"robot_{robot}" for robot in range(4)]


def report(*pairs, unused=()):
    joins = [
        Join(1.0, AGENTS[a], AGENTS[b], Transform(), (0.0, 0.0), is_used=(a, b) not in unused)
        for a, b in (*pairs, *unused)
    ]
    return PolicyReport((), Supervision(joins=joins))


def test_without_a_station_all_are_alone():
    assert joined_groups(PolicyReport(), AGENTS) == ([{0}, {1}, {2}, {3}], [])


def test_joined_pairs_make_groups():
    groups, pairs = joined_groups(report((0, 2), (3, 2)), AGENTS)
    assert sorted(map(sorted, groups)) == [[0, 2, 3], [1]]
    assert pairs == [(0, 2), (3, 2)]


def test_a_pair_within_a_group_joins_nothing_more():
    groups, pairs = joined_groups(report((0, 1), (1, 2), (0, 2)), AGENTS)
    assert sorted(map(sorted, groups)) == [[0, 1, 2], [3]]
    assert pairs == [(0, 1), (1, 2)]


def test_joins_that_wait_to_be_confirmed_do_not_count():
    assert joined_groups(report(unused=[(0, 1)]), AGENTS)[1] == []
