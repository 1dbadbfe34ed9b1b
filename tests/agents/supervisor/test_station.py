"""The station joins what it has found twice, drops what contradicts, and fuses maps without the bodies of
robots."""

import math

import numpy as np
import pytest
from drawn_maps import about_middle, apartment, blank, kept, moved, noisy, room
from reported_halls import RADIUS, RESOLUTION, hall, report

from lidarium.agents.supervisor.settings import SupervisorSettings
from lidarium.agents.supervisor.station import MergeStation, _ReceivedReports
from lidarium.envs.onboard.radio.messages import OperatingState
from lidarium.envs.onboard.station.trails import without_bodies, without_own_trail
from lidarium.mapping.merging.incremental import GrowingMap

FIRST, SECOND = about_middle(0.4, apartment()), about_middle(-1.3, apartment())


def part(columns, pose, seed=0):
    return GrowingMap(noisy(moved(kept(apartment(), slice(0, 180), columns), pose), seed))


@pytest.fixture
def station():
    """A station at which two robots were found, and confirmed when the first one's map had grown."""
    station = MergeStation(["a", "b"], RESOLUTION, RADIUS, SupervisorSettings(merge_resolution_m=RESOLUTION))
    for time_s, columns in ((2.0, 150), (4.0, 151), (6.0, 170)):
        for agent, known in (("a", part(slice(0, columns), FIRST)), ("b", part(slice(60, 220), SECOND, 1))):
            station.receive(agent, report(known, 8.0, 8.0, time_s=time_s, frame=None), time_s)
        station.merge(time_s)
    return station


def test_a_join_is_used_only_after_it_was_found_twice(station):
    assert [(join.time_s, join.is_used) for join in station.joins] == [(2.0, False), (6.0, True)]
    assert [event.event for event in station.events] == ["found", "joined"]
    true = FIRST @ SECOND.inverse()
    for join in station.joins:
        distance, angle = join.found.difference(true, join.at)
        assert distance < 0.1
        assert angle < math.radians(1.0)
    assert station.groups() == [["a", "b"]]
    assert station.lookup("a", "b").difference(true, (8.0, 8.0))[0] < 0.1


def test_a_join_that_maps_contradict_is_dropped_at_once_and_noted(station):
    station.receive(
        "b", report(GrowingMap(room(blank(320, 320), 20, 20, 90, 130)), 8.0, 8.0, time_s=8.0, frame=None), 8.0
    )
    station.merge(8.0)
    assert station.groups() == [["a"], ["b"]]
    assert [event.event for event in station.events][-1] == "dropped"
    assert station.lookup("a", "b") is None


def test_a_map_frame_that_jumps_is_followed(station):
    """After a closure a robot's map may lie elsewhere in its frame: the old transform is refused, and the
    new one has to be confirmed."""
    for time_s, columns in ((8.0, 170), (10.0, 180), (12.0, 190)):
        jumped = GrowingMap(part(slice(60, 220), SECOND, 1).levels, (2.0, -1.0))
        station.receive("a", report(part(slice(0, columns), FIRST), 8.0, 8.0, time_s=time_s, frame=None), time_s)
        station.receive("b", report(jumped, 10.0, 7.0, time_s=time_s, frame=None), time_s)
        station.merge(time_s)
    assert station.groups() == [["a", "b"]]
    x, y = station.lookup("a", "b").apply((10.0, 7.0)).tolist()
    true_x, true_y = (FIRST @ SECOND.inverse()).apply((8.0, 8.0)).tolist()
    assert math.dist((x, y), (true_x, true_y)) < 0.1


def test_robots_that_are_not_joined_have_maps_of_their_own(station):
    alone = MergeStation(["a", "b"], RESOLUTION, RADIUS, SupervisorSettings())
    alone.receive("a", report(hall(), 2.0, 2.0, frame=None), 2.0)
    assert alone.lookup("a", "b") is None
    assert alone.fused(["a", "b"], "b") is None
    alone.merge(2.0)
    assert alone.groups() == [["a"]]
    assert alone.fused(["a", "b"], "a").levels.shape == hall().levels.shape
    assert np.count_nonzero(station.fused(["a", "b"], "a").sources == 3) > 1000


def test_where_another_robot_has_been_there_is_no_wall():
    levels = hall().levels.copy()
    levels[20:30, 60:70] = 0
    trail = np.array([[1.0, 1.25], [5.0, 1.25]])
    cleaned = without_bodies(GrowingMap(levels), [trail], RADIUS, RESOLUTION).levels
    assert (cleaned[20:30, 60:70] == 127).all()
    assert (cleaned[[0, -1]] == 0).all()
    assert (cleaned[levels == 255] == 255).all()


def test_a_robot_claims_nothing_of_where_it_has_been():
    trail = np.array([[1.0, 1.25], [5.0, 1.25]])
    levels = without_own_trail(hall(), trail, RADIUS, RESOLUTION).levels
    assert (levels[20:30, 20:100] == 127).all()
    assert np.count_nonzero(levels == 127) == pytest.approx((4.0 + 0.66) * 0.66 / RESOLUTION**2, rel=0.15)


def test_teammates_of_a_robot_that_fails_learn_once_where_it_drove(station):
    trail = [(8.0, 8.0)] * 3 + [(9.0, 8.0)]
    for time_s in (8.0, 10.0):
        station.receive(
            "b",
            report(
                part(slice(60, 220), SECOND, 1),
                9.0,
                8.0,
                time_s=time_s,
                frame=None,
                state=OperatingState.FAILED,
            ),
            time_s,
        )
        station.merge(time_s)
    [(agent, told)] = station.left_behind
    assert agent == "a"
    assert np.allclose(told, (FIRST @ SECOND.inverse()).apply(np.array(trail)), atol=0.1)


def test_of_a_robot_that_fails_before_it_is_joined_nobody_learns_where_it_drove():
    alone = MergeStation(["a", "b"], RESOLUTION, RADIUS, SupervisorSettings())
    for agent, state in (("a", OperatingState.OPERATING), ("b", OperatingState.FAILED)):
        alone.receive(agent, report(hall(), 2.0, 2.0, frame=None, state=state), 2.0)
    assert alone.left_behind == []


SETTINGS = SupervisorSettings()
WAY = SETTINGS.enclosed_way_m


def received(*reports):
    found = _ReceivedReports(["a", "b"], RESOLUTION, SETTINGS)
    for each in reports:
        found.add("a", each)
    return found


def known(share):
    """A map of which a share of 40 m2 is known."""
    levels = np.full((100, 160), 127, np.uint8)
    levels[: round(100 * share)] = 255
    return GrowingMap(levels)


def test_the_latest_report_says_where_a_robot_is_and_all_say_where_it_was():
    found = received(report(hall(), 1.0, 2.0), report(hall(), 2.0, 2.5))
    assert found.place("a") == (2.0, 2.5)
    assert found.trail("a").tolist() == [[1.0, 2.0], [2.0, 2.5]]
    assert found.trail("b").shape == (0, 2)


def test_the_known_area_is_that_of_the_latest_map():
    found = received(report(known(0.5), 1.0, 2.0), report(known(0.25), 1.0, 2.0))
    assert found.known_m2("a") == pytest.approx(10.0)
    assert found.known_m2("b") == 0.0


def test_maps_of_robots_that_failed_know_nothing_or_never_reported_are_not_used():
    assert received(report(hall(), 1.0, 2.0)).is_used("a")
    assert not received(report(hall(), 1.0, 2.0, state=OperatingState.FAILED)).is_used("a")
    assert not received(report(known(0.0), 1.0, 2.0)).is_used("a")
    assert not received().is_used("a")


def test_a_robot_that_maps_too_little_on_its_way_is_enclosed():
    def after(*ways_and_shares):
        return received(*(report(known(share), 1.0, 2.0, travelled_m=way) for way, share in ways_and_shares))

    assert not after().is_enclosed("a")
    assert not after((0.0, 0.5), (0.9 * WAY, 0.5)).is_enclosed("a")
    assert after((0.0, 0.5), (0.5 * WAY, 0.5), (1.1 * WAY, 0.5)).is_enclosed("a")
    gain = 1.1 * SETTINGS.enclosed_gain_m2_per_m * 1.1 * WAY / 40.0
    assert not after((0.0, 0.1), (1.1 * WAY, 0.1 + max(gain, 0.05))).is_enclosed("a")
