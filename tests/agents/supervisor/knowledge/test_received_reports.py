"""The reports that have reached a station."""

import numpy as np
import pytest
from reported_halls import RESOLUTION, hall, report

from lidarium.agents.supervisor.knowledge.received_reports import ReceivedReports
from lidarium.agents.supervisor.settings import SupervisorSettings
from lidarium.envs.onboard.radio.messages import OperatingState
from lidarium.mapping.merging.growing_maps import GrowingMap

SETTINGS = SupervisorSettings()
WAY = SETTINGS.enclosed_way_m


def received(*reports):
    found = ReceivedReports(["a", "b"], RESOLUTION, SETTINGS)
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
