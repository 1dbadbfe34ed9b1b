"""Odometry that stops, jumps, has other axes or units, or turns against the scans."""

import math
from dataclasses import replace

import numpy as np
import pytest
from driven_rooms import GEOMETRY, driven, odd_room

from lidarium.mapping.files.laser_logs import LaserLog, made_usable
from lidarium.mapping.geometry.rigid import composed, relative
from lidarium.mapping.localization.slam.following import LOG_SETTINGS, follow


@pytest.fixture(scope="module")
def run():
    return driven(odd_room(), [(1.0, 1.0), (5.0, 1.0), (5.0, 2.6), (2.6, 2.6), (2.6, 1.4), (5.0, 1.4)], noise=0.005)


@pytest.fixture(scope="module")
def log(run):
    return LaserLog(
        stamps=np.array([one.time_s for one in run.sensings]),
        ranges=np.stack([one.ranges for one in run.sensings]),
        geometry=GEOMETRY,
        odometry=np.stack([one.odometry for one in run.sensings]),
    )


def with_motions(log, change):
    """Return a log whose motions by odometry were changed."""
    motions = relative(log.odometry[:-1], log.odometry[1:])
    change(motions)
    poses = [log.odometry[0]]
    for motion in motions:
        poses.append(composed(poses[-1], motion))
    return replace(log, odometry=np.array(poses))


def frozen(log, first, last):
    def change(motions):
        motions[first:last] = 0.0

    return with_motions(log, change)


def test_a_log_without_faults_stays_as_it_is(log):
    found = made_usable(log, "log")
    np.testing.assert_array_equal(found.odometry, log.odometry)
    np.testing.assert_array_equal(found.ranges, log.ranges)
    assert not found.remarks


@pytest.mark.parametrize("end", [45, -1])
def test_odometry_that_stops_while_scans_move_is_told_and_done_without(run, log, end):
    last = range(len(log.stamps))[end]
    found = made_usable(frozen(log, 20, last), "log")
    (remark,) = found.remarks
    assert f"stands still while the scans move, from {log.stamps[20]:.3f} to {log.stamps[last]:.3f} s" in remark
    assert np.flatnonzero(np.isnan(found.odometry[:, 0])).tolist() == list(range(21, last + 1))
    followed = follow(found, LOG_SETTINGS)
    assert np.abs(followed.poses - run.truth)[:, :2].max() < 0.1


def test_a_robot_that_stands_still_is_no_fault(log):
    draws = np.random.default_rng(0)
    waits = np.repeat(np.arange(len(log.stamps)), np.where(np.arange(len(log.stamps)) == 20, 30, 1))
    noise = draws.normal(0.0, 0.005, (len(waits), GEOMETRY.beams)).astype(np.float32)
    standing = LaserLog(0.2 * np.arange(len(waits)), log.ranges[waits] + noise, GEOMETRY, log.odometry[waits])
    assert not made_usable(standing, "log").remarks


def test_odometry_that_is_read_at_every_fourth_scan_is_no_fault(log):
    seldom = replace(log, odometry=log.odometry[np.arange(len(log.stamps)) // 4 * 4])
    assert not made_usable(seldom, "log").remarks


def test_odometry_that_is_missing_is_told_and_leaves_the_rest(log):
    odometry = log.odometry.copy()
    odometry[5:8], odometry[20] = np.nan, np.nan
    found = made_usable(replace(log, odometry=odometry), "log")
    np.testing.assert_array_equal(found.odometry, odometry)
    (remark,) = found.remarks
    first, last = log.stamps[[5, 7]]
    assert (
        f"missing in 2 stretches while the robot moves, the longest from {first:.3f} to {last:.3f} s: 4 scans" in remark
    )


@pytest.mark.parametrize(
    ("name", "change", "words"),
    [
        ("degrees", lambda o: o * [1.0, 1.0, 180.0 / math.pi], "headings of odometry are in degrees"),
        ("swapped", lambda o: o[:, [1, 0, 2]], "x and y of odometry are swapped"),
        ("clockwise", lambda o: o * [1.0, 1.0, -1.0], "headings of odometry are clockwise"),
    ],
)
def test_other_axes_and_units_of_odometry_are_found_and_told(name, change, words, log):
    found = made_usable(replace(log, odometry=change(log.odometry)), "log")
    np.testing.assert_allclose(found.odometry, log.odometry, atol=1e-9)
    (remark,) = found.remarks
    assert words in remark
    # Also if a part is missing.
    part = np.where(np.arange(len(log.stamps))[:, None] < 8, np.nan, log.odometry)
    found = made_usable(replace(log, odometry=change(part)), "log")
    np.testing.assert_allclose(found.odometry, part, atol=1e-9)
    assert words in found.remarks[-1]


def test_mirrored_scans_are_turned_over_and_told(log):
    found = made_usable(replace(log, ranges=np.ascontiguousarray(log.ranges[:, ::-1])), "log")
    np.testing.assert_array_equal(found.ranges, log.ranges)
    (remark,) = found.remarks
    assert "scans turn against odometry" in remark


def test_a_field_of_view_that_is_not_the_lasers_is_told(log):
    narrow = replace(log, geometry=replace(GEOMETRY, field_of_view=math.radians(160.0)))
    (remark,) = made_usable(narrow, "log").remarks
    assert remark.startswith("turns contradict each other: scans turn 0.6")


def test_odometry_in_centimetres_is_refused(log):
    with pytest.raises(ValueError, match=r"moves at \d+ a second, as odometry in centimetres"):
        made_usable(replace(log, odometry=log.odometry * [100.0, 100.0, 1.0]), "log")
