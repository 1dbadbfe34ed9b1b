"""Logs whose beams are said wrongly: circles, fields of view, counts, upside-down lasers."""

import math

import numpy as np
import pytest

from lidarium.mapping.files.carmen_logs import read_carmen_log
from lidarium.mapping.files.laser_logs import symmetric_scans
from lidarium.mapping.files.mending.beam_directions import Beams, resampled

TURN = 2.0 * math.pi


def line(stamp, ranges, start, view, step, pose=(0.0, 0.0, 0.0)):
    numbers = " ".join(f"{value:.3f}" for value in ranges)
    places = " ".join(map(str, (*pose, *pose)))
    return (
        f"ROBOTLASER1 0 {start:.6f} {view:.6f} {step:.6f} 20.0 0.01 0 {len(ranges)} {numbers} 0 "
        f"{places} 0 0 0 0 0 {stamp} host {stamp}\n"
    )


def wall_ahead(angles):
    """Ranges to a wall 4 m ahead within 60 degrees, and to a circle of 6 m elsewhere."""
    return np.where(np.abs(angles) < math.radians(60.0), 4.0 / np.cos(angles), 6.0)


def read(tmp_path, *lines, **options):
    (tmp_path / "run.log").write_text("".join(lines))
    return read_carmen_log(tmp_path / "run.log", **options)


def flaser(stamp, ranges):
    return f"FLASER {len(ranges)} {' '.join(map(str, ranges))} 0 0 0 0 0 0 {stamp} host {stamp}\n"


@pytest.mark.parametrize("beams", [180, 231, 360, 720, 1000, 1439, 1440])
@pytest.mark.parametrize("start", [0.0, -math.pi])
def test_a_circle_with_six_decimals_is_a_circle_whose_beams_stay_where_they_are(tmp_path, beams, start):
    angles = start + np.arange(beams) * TURN / beams
    ranges = 5.0 + np.sin(angles)
    log = read(tmp_path, line(1.0, ranges, start, TURN, TURN / beams))
    assert log.geometry.is_full_circle
    assert log.geometry.beams == beams
    expected = 5.0 + np.sin(log.geometry.angles + log.laser_pose[2])
    np.testing.assert_allclose(log.ranges[0], expected, atol=2e-3)


def test_beams_that_are_not_symmetric_turn_the_laser_by_less_than_a_beam():
    ranges = np.arange(1.0, 6.0, dtype=np.float32)[None]
    _, geometry, axis = symmetric_scans(ranges, -math.pi, TURN / 5, (0.0, 9.0))
    assert geometry.angles[0] + axis == pytest.approx(-math.pi)
    wide, geometry, axis = symmetric_scans(ranges, -0.45, 0.2, (0.0, 9.0))
    first = int(np.flatnonzero(np.isfinite(wide[0]))[0])
    assert geometry.angles[first] + axis == pytest.approx(-0.45)
    assert abs(axis) <= 0.1


def test_scans_of_varying_beam_counts_are_resampled_on_one_grid(tmp_path):
    lines = []
    for k, beams in enumerate([120, 115, 120, 123, 125, 120]):
        start = -math.pi + TURN / beams
        angles = start + np.arange(beams) * TURN / beams
        lines.append(line(float(k), wall_ahead(angles), start, TURN, TURN / beams, (0.1 * k, 0.0, 0.0)))
    log = read(tmp_path, *lines)
    assert log.ranges.shape == (6, 120)
    assert any("3 x" in remark and "resampled" in remark for remark in log.remarks)
    is_wall = np.abs(log.geometry.angles + log.laser_pose[2]) < math.radians(55.0)
    expected = wall_ahead(log.geometry.angles + log.laser_pose[2])
    np.testing.assert_allclose(
        log.ranges[:, is_wall], np.broadcast_to(expected[is_wall], (6, is_wall.sum())), atol=0.02
    )


def test_a_resampled_scan_invents_nothing_between_two_surfaces():
    ranges = np.array([1.0, 1.02, 9.0, np.inf, np.nan], np.float32)
    found = resampled(ranges, Beams(0.0, 0.1), Beams(-0.08, 0.05), 12)
    np.testing.assert_allclose(
        found, [np.nan, 1.0, 1.004, 1.014, 1.02, 9.0, 9.0, np.inf, np.inf, np.nan, np.nan, np.nan], atol=1e-6
    )


def test_steps_that_contradict_count_and_field_of_view_are_not_believed(tmp_path):
    ranges = np.linspace(1.0, 5.0, 91)
    log = read(tmp_path, line(1.0, ranges, -math.pi / 2, math.pi, 90.0))
    assert log.geometry.field_of_view == pytest.approx(math.pi, abs=1e-5)
    np.testing.assert_allclose(log.ranges[0], ranges, atol=1e-3)
    assert any("contradict 91 beams" in remark for remark in log.remarks)


def test_scans_of_an_upside_down_laser_are_reversed(tmp_path):
    ranges = np.linspace(1.0, 5.0, 91)
    upright = read(tmp_path, line(1.0, ranges, -math.pi / 2, math.pi, math.pi / 90))
    hanging = read(tmp_path, line(1.0, ranges[::-1], math.pi / 2, -math.pi, -math.pi / 90))
    np.testing.assert_array_equal(upright.ranges, hanging.ranges)
    assert hanging.laser_pose == pytest.approx(upright.laser_pose, abs=1e-5)
    assert any("clockwise" in remark for remark in hanging.remarks)
    assert not upright.remarks


def test_a_log_says_by_parameters_how_far_a_laser_looks(tmp_path):
    parameters = "PARAM laser_front_laser_fov 270 h 0\nPARAM laser_front_laser_resolution 2.0 h 0\n"
    scan = flaser(1.0, [2.0] * 136)
    assert math.degrees(read(tmp_path, parameters, scan).geometry.field_of_view) == pytest.approx(270.0)
    silent = read(tmp_path, scan)
    assert math.degrees(silent.geometry.field_of_view) == pytest.approx(180.0)
    assert any("136 beams, as no SICK has" in remark for remark in silent.remarks)
    named = read(tmp_path, scan, field_of_view=math.radians(270.0))
    assert math.degrees(named.geometry.field_of_view) == pytest.approx(270.0)
    assert not named.remarks


def test_parameters_that_contradict_a_sick_are_not_believed(tmp_path):
    scan = flaser(1.0, [2.0] * 401)
    log = read(tmp_path, "PARAM laser_front_laser_fov 180 h 0\n", scan)
    assert math.degrees(log.geometry.field_of_view) == pytest.approx(100.0)
    assert not log.remarks
