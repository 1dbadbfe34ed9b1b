"""Motions that odometry does not know are found, or named as doubtful."""

import math
from dataclasses import replace

import numpy as np
import pytest
from driven_rooms import GEOMETRY, driven, odd_room

from lidarium.mapping.geometry.rigid import composed, relative
from lidarium.mapping.localization.matching.settings.slam import SlamSettings
from lidarium.mapping.localization.slam.doubts import ELSEWHERE, NO_MATCH, ODOMETRY_ALONE, Doubt, Doubts
from lidarium.mapping.localization.slam.localizer import Slam

ROUND = [(1.0, 1.0), (4.5, 1.0), (4.5, 2.4), (1.5, 2.4), (1.0, 1.0)]


def with_hidden_turn(run):
    """Leave out the scans of the first turn of more than 60 degrees; odometry does not know it."""
    turned = np.concatenate([[0.0], np.cumsum(np.diff(run.truth[:, 2]))])
    first = int(np.flatnonzero(np.abs(np.diff(turned)) > 0.05)[0])
    last = int(np.flatnonzero(np.abs(turned - turned[first]) > math.radians(80.0))[0])
    kept = [*range(first + 1), *range(last, len(run.sensings))]
    odometry, sensings = np.zeros(3), []
    for before, here in zip([kept[0], *kept[:-1]], kept, strict=True):
        if here - before <= 1:
            odometry = composed(odometry, relative(run.truth[before], run.truth[here]))
        sensings.append(replace(run.sensings[here], odometry=odometry.copy()))
    return sensings, run.truth[kept], first + 1


def test_a_turn_that_odometry_does_not_know_is_found():
    sensings, truth, at = with_hidden_turn(driven(odd_room(), ROUND))
    slam = Slam(SlamSettings(), GEOMETRY)
    found = np.array([slam.localize(sensing) for sensing in sensings])
    assert abs(relative(truth[at - 1], truth[at])[2]) > math.radians(75.0)
    assert slam.counts.recoveries == 1
    assert slam.counts.restarts == 0
    assert np.hypot(*(found - truth)[:, :2].T).max() < 0.1
    [doubt] = slam.doubts.stretches
    assert doubt.reason == ELSEWHERE
    # A scan is matched after some motion: here the second one after the turn.
    assert doubt.start_s <= sensings[at].time_s <= doubt.end_s <= sensings[at + 3].time_s


def test_stretches_begin_at_the_last_sure_scan_and_grow():
    doubts = Doubts()
    for time_s, reason in [(0.0, None), (1.0, NO_MATCH), (2.0, NO_MATCH), (3.0, None), (4.0, ODOMETRY_ALONE)]:
        doubts.note(time_s, reason)
    doubts.note(5.0, NO_MATCH)
    assert doubts.stretches == [
        Doubt(0.0, 2.0, 2, NO_MATCH),
        Doubt(3.0, 4.0, 1, ODOMETRY_ALONE),
        Doubt(3.0, 5.0, 1, NO_MATCH),
    ]


def test_a_kidnapped_robot_is_doubtful():
    before = driven(odd_room(), ROUND[:3])
    other = np.array(
        [[-9.0, -7.0, 9.0, -7.0], [9.0, -7.0, 9.0, 0.4], [9.0, 0.4, -9.0, 0.4], [-9, 0.4, -9, -7]]
    )
    after = driven(other, [(0.0, 0.0), (2.0, -0.4), (2.0, -2.0)])
    last = before.sensings[-1]
    moved = [
        replace(s, time_s=s.time_s + last.time_s + 1.0, odometry=composed(last.odometry, s.odometry))
        for s in after.sensings
    ]
    slam = Slam(SlamSettings(), GEOMETRY)
    for sensing in [*before.sensings, *moved]:
        slam.localize(sensing)
    doubt = slam.doubts.stretches[0]
    assert doubt.start_s == pytest.approx(last.time_s, abs=0.6)
    assert doubt.end_s > last.time_s
