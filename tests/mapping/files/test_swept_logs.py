"""Motion during a scan is corrected beam by beam; a remark reports scans that cannot be corrected."""

import math

import numpy as np
import pytest

from lidarium.mapping.files.log_files import read_log
from lidarium.mapping.localization.matching.scan_points import at_last_beam

DEGREE, INTERVAL_S, TURN_RATE = math.pi / 180.0, 0.1 / 360.0, 1.5


def room(angles):
    """Return the ranges from the middle of a room of 8 x 6 m."""
    with np.errstate(divide="ignore"):
        return np.minimum(4.0 / np.abs(np.cos(angles)), 3.0 / np.abs(np.sin(angles)))


def turning(path, first, beams, is_hanging=False):
    """Return the log of a robot that turns on the spot, with stamps of the last beam."""
    stamps = 1.0 + 0.2 * np.arange(30)
    angles = first + DEGREE * np.arange(beams)
    ages = INTERVAL_S * np.arange(beams - 1, -1, -1)
    # From a laser upside down, the first beam in time is the last one from right to left.
    headings = TURN_RATE * (stamps[:, None] - (ages[::-1] if is_hanging else ages))
    ranges = room(headings + angles)[:, :: -1 if is_hanging else 1]
    np.savez(
        path,
        ranges=ranges,
        angle_min=-angles[-1] if is_hanging else angles[0],
        angle_increment=DEGREE,
        stamp=stamps,
        pose_odom=np.stack([np.zeros(30), np.zeros(30), TURN_RATE * stamps], axis=1),
        max_range=20.0,
        beam_interval=INTERVAL_S,
    )
    return read_log(path)


def error(log):
    """Return the largest difference of the fifth scan without motion from the room as seen from its odometry [m]."""
    motion = np.array([0.0, 0.0, 0.2 * TURN_RATE])
    found = at_last_beam(log.ranges[4], log.geometry, motion, log.beam_interval_s, 0.2)
    true = room(log.odometry[4, 2] + log.geometry.angles + log.laser_pose[2])
    return np.nanmax(np.abs(found - true))


@pytest.mark.parametrize("first", [-180, -45, -135])
def test_stamps_are_those_of_the_last_beam_that_was_taken(tmp_path, first):
    log = turning(tmp_path / "log.npz", first * DEGREE, 360 if first == -180 else 181)
    assert error(log) < 0.06
    assert not log.remarks
    assert log.stamps[0] == pytest.approx(1.0 + (90 * INTERVAL_S if first == -135 else 0.0))


@pytest.mark.parametrize("is_hanging", [False, True])
def test_beams_that_are_not_in_the_order_of_time_have_no_interval(tmp_path, is_hanging):
    log = turning(tmp_path / "log.npz", -math.pi / 2 if is_hanging else 0.0, 181 if is_hanging else 360, is_hanging)
    assert log.beam_interval_s == 0.0
    assert not log.is_in_time
    assert log.remarks[-1].startswith("motion within scans is not undone")
    assert log.swept(INTERVAL_S).beam_interval_s == 0.0


def test_readings_with_the_faults_of_odometry_are_left_out(shared_cases):
    log = read_log(shared_cases / "odometry-jump" / "reset.log.gz")
    assert any("the jumps are taken out" in remark for remark in log.remarks)
    assert not len(log.readings)
