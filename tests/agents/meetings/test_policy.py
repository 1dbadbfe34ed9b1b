"""Teams whose radio breaks, in whole episodes."""

import numpy as np
import pytest
from scipy import ndimage
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

import lidarium
from lidarium.agents.meetings.policy import MeetingFrontier, MeetingTours
from lidarium.agents.meetings.tethered import Tethered
from lidarium.envs.floors.floor import Floor, Solid
from lidarium.envs.settings.faults import Fault, FaultSettings
from lidarium.envs.settings.making import make_settings
from lidarium.evaluation.episodes.history import History
from lidarium.evaluation.episodes.runner import run_episode
from lidarium.evaluation.episodes.watching import WatchedExploration

NEAR = {"kind": "range", "reach": 3.0}


def wall(x, y, width, height):
    return Solid(np.array([[x, y], [x + width, y], [x + width, y + height], [x, y + height]]))


def corridor(robots):
    """A corridor of 24 m; robots start around its middle and look to both ends."""
    starts = np.array([[12.0 + 0.8 * (k - 0.5 * (robots - 1)), 1.0, np.pi * (k + 1)] for k in range(robots)])
    return Floor("corridor", (0.0, 0.0, 24.0, 2.0), (), starts=starts)


def finished(policy, floor, seed=0, **settings):
    chosen = {"resolution": 0.1, "horizon_s": 600.0, "stop_coverage": None, "starts": "fixed", **settings}
    history = History()
    env = WatchedExploration(floor, make_settings(**chosen), watchers=[history])
    return run_episode(policy, env, seed), history


def test_an_ideal_radio_and_a_robot_alone_give_tour_frontier_to_the_bit():
    for settings in ({"robots": 3}, {"robots": 1, "radio": "signal"}):
        ours, _ = finished(MeetingTours(), "building:4", **settings)
        tours, _ = finished(lidarium.policy("tour_frontier"), "building:4", **settings)
        assert np.array_equal(ours.env.world.poses, tours.env.world.poses)
        assert ours.env.scorer.time == tours.env.scorer.time


@pytest.mark.parametrize("make", [MeetingTours, MeetingFrontier])
def test_two_robots_in_a_corridor_part_and_meet_in_its_middle(make):
    policy = make(rule="meeting")
    episode, history = finished(policy, corridor(2), robots=2, radio=NEAR)
    own = history.curves.c_own[-1]
    assert own.min() == own.max() >= 0.985
    # Both ends are open, and as far from there.
    assert policy.agreed[0].place[0] == pytest.approx(12.0, abs=1.5)
    assert all(book.given_up == set() for book in policy.notebooks.values())
    assert set(episode.env.scorer.ended_because.values()) <= {"no_frontier", "frontier_unreachable"}


def test_all_that_live_know_the_floor_if_a_teammate_dies():
    faults = FaultSettings(schedule=(Fault(kind="dead_robot", robot=1, at_s=12.0),))
    policy = MeetingTours(minimum_s=40.0, maximum_s=40.0)
    episode, history = finished(policy, corridor(3), robots=3, radio=NEAR, faults=faults)
    assert history.curves.c_own[-1][[0, 2]].min() >= 0.99
    assert episode.env.scorer.time < 600.0
    assert any("robot_1" in policy.notebooks[agent].given_up for agent in ("robot_0", "robot_2"))


def test_robots_do_not_wait_for_ever_for_one_that_agreed_on_another_meeting():
    faults = FaultSettings(schedule=(Fault(kind="dead_robot", robot=3, at_s=15.0),))
    policy = MeetingTours()
    _, history = finished(policy, "building:3000022", robots=4, radio="signal", faults=faults, horizon_s=650.0)
    first = [each for each in policy.agreed if each.time_s < 450.0]
    assert len({each.place for each in first if each.number == first[-1].number}) > 1
    assert history.curves.c_own[-1][:3].min() >= 0.99


@pytest.mark.parametrize("loss", [0.0, 0.1, 0.5, 0.9])
@pytest.mark.parametrize("rule", ["meeting", "pursuit"])
def test_lost_messages_delay_a_team_and_do_not_end_it(loss, rule):
    episode, history = finished(MeetingTours(rule=rule), corridor(2), robots=2, radio={**NEAR, "loss": loss})
    assert history.curves.c_own[-1].min() >= 0.99
    assert episode.env.scorer.time < 600.0


@pytest.mark.parametrize("name", ["meeting_tours", "meeting_frontier", "tethered", "oblivious"])
def test_every_team_learns_a_floor_of_rooms_and_the_same_seed_gives_the_same_run(name):
    first, history = finished(lidarium.policy(name), "building:4", robots=3, radio="signal")
    second, _ = finished(lidarium.policy(name), "building:4", robots=3, radio="signal")
    assert history.curves.c_own[-1].min() >= 0.99
    assert np.array_equal(first.env.world.poses, second.env.world.poses)
    assert first.env.scorer.time == second.env.scorer.time


def test_a_tethered_team_keeps_in_touch():
    policy = lidarium.policy("tethered")
    episode, _ = finished(policy, corridor(3), robots=3, radio={"kind": "range", "reach": 5.0})
    assert episode.env.perception.exchanges[0].links.any(axis=1).all()
    assert all(not book.given_up for book in policy.notebooks.values())


@pytest.mark.parametrize("make", [MeetingTours, MeetingFrontier, Tethered])
@pytest.mark.parametrize(
    "radio",
    [
        "none",
        {"kind": "range", "reach": 0.3},
        {"kind": "line_of_sight", "reach": 0.3},
        {"kind": "signal", "power": -300.0},
        {"kind": "signal", "threshold": 0.0},
    ],
)
def test_a_radio_that_never_connects_is_refused(make, radio):
    with pytest.raises(
        ValueError, match=rf"{make.__name__} needs a radio, but '\w+' never connects .* 0\.36 m apart; want"
    ):
        finished(make(), corridor(2), robots=2, radio=radio)


def test_a_radio_that_connects_by_chance_or_over_half_a_metre_is_not():
    for radio in ({"kind": "range", "reach": 0.5}, {"kind": "signal", "power": -40.0, "shadowing": 4.0}):
        finished(MeetingTours(), corridor(2), robots=2, radio=radio, horizon_s=2.0)


def test_robots_with_unknown_starts_are_refused():
    with pytest.raises(ValueError, match="MeetingTours agrees on places, which robots with unknown starts cannot"):
        finished(MeetingTours(), corridor(2), robots=2, radio="range", known_starts=False)
    with pytest.raises(ValueError, match="'hurry'"):
        MeetingTours(hurry=1.0)
    with pytest.raises(ValueError, match="'hurry'"):
        MeetingFrontier(hurry=1.0)


class SlowlyChecked(MeetingTours):
    """Compares each position of a meeting with the best of a slow search over all cells."""

    def _best_place(self, agent, members, cells):
        place = super()._best_place(agent, members, cells)
        navigation, news = self.navigation(agent), self.notebooks[agent].news
        goals = [*(self._cell_of(agent, news[name].goal) for name in members), *map(tuple, cells)]
        lengths = [lengths_from(goal, navigation, self.team.belief(agent).radius) for goal in goals]
        longest = np.max(lengths, axis=0)
        if np.isfinite(longest).any():
            self.compared.append((longest[self._cell_of(agent, place)], longest[np.isfinite(longest)]))
        return place


def lengths_from(cell, navigation, radius):
    """Return the lengths of the shortest paths of a body from a cell, or the room nearest to it, to all cells [m]."""
    side = navigation.resolution
    room = ndimage.distance_transform_edt(navigation.log_odds < 0) * side > radius
    rows, columns = np.nonzero(room)
    number = np.full(room.shape, -1)
    number[rows, columns] = np.arange(len(rows))
    ends, weights = [], []
    for down, right in ((0, 1), (1, 0), (1, 1), (1, -1)):
        there = number[np.clip(rows + down, 0, len(room) - 1), np.clip(columns + right, 0, room.shape[1] - 1)]
        ends.append(np.stack([np.arange(len(rows)), there])[:, there >= 0])
        weights.append(np.full(ends[-1].shape[1], side * np.hypot(down, right)))
    graph = coo_array((np.concatenate(weights), np.concatenate(ends, axis=1)), shape=(len(rows), len(rows)))
    nearest = int(np.argmin(np.hypot(rows - cell[0], columns - cell[1])))
    found = np.full(room.shape, np.inf)
    found[rows, columns] = dijkstra(graph, directed=False, indices=nearest)
    return found


def test_meetings_are_where_the_longest_way_is_shortest():
    policy = SlowlyChecked()
    policy.compared = []
    finished(policy, "building:4", robots=3, radio="signal", horizon_s=60.0)
    assert len(policy.compared) > 5
    for chosen, others in policy.compared:
        # Planned paths keep off walls, which makes some ways longer.
        assert others.min() <= chosen <= others.min() + 1.0
        assert chosen < 0.8 * np.median(others)
