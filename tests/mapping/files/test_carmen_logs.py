"""Logs whose beams are said wrongly: circles, fields of view, counts, upside-down lasers."""

import gzip
import math

import numpy as np
import pytest

from lidarium.mapping.files.beams import Beams, resampled, symmetric_scans
from lidarium.mapping.files.carmen_logs import (
    _Content,
    _give_directions,
    _on_one_grid,
    _parameter,
    _read_line,
    _Scan,
    read_carmen_log,
)
from lidarium.mapping.geometry.rigid import composed
from lidarium.mapping.grids.scan_geometry import ScanGeometry

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
    _, geometry, axis, *_ = symmetric_scans(ranges, -math.pi, TURN / 5, (0.0, 9.0))
    assert geometry.angles[0] + axis == pytest.approx(-math.pi)
    wide, geometry, axis, *_ = symmetric_scans(ranges, -0.45, 0.2, (0.0, 9.0))
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


FLASER = "FLASER 3 1.0 2.0 3.0 0.5 0.6 0.1 0.4 0.5 0.2 12.5 host 12.6"
ROBOTLASER = "ROBOTLASER1 0 -1.0 2.0 1.0 30.0 0.1 0 3 1.0 2.0 3.0 1 9 0.5 0.6 0.1 0.4 0.5 0.2 1 2 3 4 5 13.5 host 13.6"


def said(*lines):
    content = _Content()
    for line in lines:
        _read_line(line, content)
    return content


def test_an_old_scan_has_ranges_poses_and_a_stamp_but_no_directions():
    ((scan, before),) = said("ODOM 0 0 0 0 0 0 1.0 host 1.0", FLASER).scans
    assert (scan.ranges, scan.stamp, before) == ([1.0, 2.0, 3.0], 12.5, 1)
    assert (scan.laser_pose, scan.robot_pose) == ([0.5, 0.6, 0.1], [0.4, 0.5, 0.2])
    assert scan.beams is None
    assert not scan.has_angles
    assert math.isnan(scan.max_range)


def test_a_new_scan_says_its_directions_and_longest_range():
    ((scan, _),) = said(ROBOTLASER).scans
    assert (scan.ranges, scan.stamp, scan.max_range) == ([1.0, 2.0, 3.0], 13.5, 30.0)
    assert (scan.laser_pose, scan.robot_pose) == ([0.5, 0.6, 0.1], [0.4, 0.5, 0.2])
    assert scan.has_angles


def test_odometry_is_stamped_as_scans_are_or_else_by_the_last_word():
    content = said("ODOM 1 2 0.5 0.1 0.2 0.3 7.5 host 7.6", "ODOM 1 2 0.5 8.5")
    assert content.odometry == [([1.0, 2.0, 0.5], 7.5), ([1.0, 2.0, 0.5], 8.5)]


@pytest.mark.parametrize("stamp", ["nan", "inf"])
def test_a_scan_without_a_stamp_is_left_out_alone(tmp_path, stamp):
    lines = [f"FLASER 2 3.0 2.0 {k} 0 0 {k} 0 0 {stamp if k == 7 else k} host {k}" for k in range(20)]
    (tmp_path / "run.log").write_text("\n".join(lines))
    log = read_carmen_log(tmp_path / "run.log")
    assert log.stamps.tolist() == [float(k) for k in range(20) if k != 7]
    assert log.skipped == {"scans without a stamp": 1}


def test_parameters_are_numbers_or_none():
    content = said("PARAM laser_fov 180 1 host 1", "PARAM laser_name sick 1", "PARAM laser_max inf 1")
    assert _parameter(content, "laser_fov") == 180.0
    for name in ("laser_name", "laser_max", "laser_other"):
        assert _parameter(content, name) is None


@pytest.mark.parametrize(
    "line",
    [
        "FLASER 4 1.0 2.0 3.0 0.5 0.6",
        "FLASER x 1.0",
        "FLASER 0 0 0 0 0 0 0 1.0",
        "FLASER 1 1.0 nan 0 0 0 0 0 1.0",
        ROBOTLASER[:60],
        "ODOM 1 2",
    ],
)
def test_damaged_lines_are_counted(line):
    content = said(line)
    assert content.scans == content.odometry == []
    assert content.skipped == {f"damaged {line.split()[0]} lines": 1}


def test_lines_that_are_not_needed_are_quiet_and_unknown_ones_are_counted():
    content = said("# remark", "", "SYNC 1", "TRUEPOS 0 0 0", "SONAR 1 2", "SONAR 3 4", "NEFF 3")
    assert content.skipped == {"SONAR lines": 2}
    assert content.is_corrected


def scan_of(ranges, max_range=math.nan):
    return _Scan(list(ranges), 1.0, [0.0] * 3, [0.0] * 3, None, max_range, has_angles=False)


def content_of(*scans, **parameters):
    content = _Content(scans=[(scan, 0) for scan in scans])
    content.parameters.update({f"laser_front_laser_{name}": value for name, value in parameters.items()})
    _give_directions(content, None)
    return content


def test_the_field_of_view_is_that_of_the_log():
    content = content_of(scan_of([1.0, 2.0, 3.0]), fov="90")
    beams = content.scans[0][0].beams
    assert beams.angle_min == pytest.approx(-math.pi / 4.0)
    assert beams.increment == pytest.approx(math.pi / 4.0)


def test_scans_of_another_number_of_beams_are_left_out_and_counted():
    content = content_of(scan_of([1.0, 2.0, 3.0]), scan_of([1.0, 2.0]), scan_of([4.0, 5.0, 6.0]), fov="90")
    kept, _, ranges, _ = _on_one_grid(content)
    assert len(kept) == 2
    np.testing.assert_array_equal(ranges, [[1.0, 2.0, 3.0], [4.0, 5.0, np.inf]])
    assert content.skipped == {"scans that have not 3 beams as most": 1}


def test_the_longest_range_is_no_return_and_what_is_not_above_zero_is_invalid():
    content = content_of(scan_of([5.0, 0.0, 8.0]), scan_of([-1.0, 8.0, math.nan]), fov="90")
    _, _, ranges, longest = _on_one_grid(content)
    assert longest == 8.0
    np.testing.assert_array_equal(ranges, [[5.0, np.nan, np.inf], [np.nan, np.inf, np.nan]])


def test_what_the_log_says_of_the_longest_range_counts():
    content = content_of(scan_of([5.0, 30.0, 29.0], max_range=30.0), fov="90")
    _, _, ranges, longest = _on_one_grid(content)
    assert longest == 30.0
    np.testing.assert_array_equal(ranges, [[5.0, np.inf, 29.0]])


def test_a_laser_that_gives_eighty_metres_and_more_has_no_return_there():
    content = content_of(scan_of([5.0, 81.91, 80.0]), fov="90")
    _, _, ranges, longest = _on_one_grid(content)
    assert longest == 80.0
    np.testing.assert_array_equal(ranges, [[5.0, np.inf, np.inf]])


def flaser_of_carmen_logs(stamp, ranges, pose=(0.0, 0.0, 0.0), odometry=None, end="host 0"):
    numbers = [len(ranges), *ranges, *pose, *(odometry or pose), stamp]
    return f"FLASER {' '.join(map(str, numbers))} {end}\n"


def odom(stamp, x=0.0, y=0.0, theta=0.0):
    return f"ODOM {x} {y} {theta} 0 0 0 {stamp} host {stamp}\n"


def robotlaser(stamp, ranges, laser=(0.1, 0.0, 0.0), robot=(0.0, 0.0, 0.0), max_range=8.0):
    step = math.pi / (len(ranges) - 1)
    head = (
        f"ROBOTLASER1 0 {-math.pi / 2} {math.pi} {step} {max_range} 0.01 0 {len(ranges)} {' '.join(map(str, ranges))}"
    )
    return f"{head} 0 {' '.join(map(str, (*laser, *robot)))} 0 0 0.1 0.1 0 {stamp} host {stamp}\n"


SCAN = [1.0, 2.0, 3.0, 4.0, 5.0]


def read_of_carmen_logs(tmp_path, *lines, name="run.log"):
    path = tmp_path / name
    content = "".join(lines).encode()
    path.write_bytes(gzip.compress(content) if name.endswith(".gz") else content)
    return read_carmen_log(path)


def corrected_lines(missing=(), without_own=None):
    """A GridFastSLAM log: a reading every 0.5 s and 0.2 m; they go on from each scan's own pose."""
    lines, x, y = [], 0.0, 0.0
    for k in range(12):
        x += 0.2 if k else 0.0
        if k not in missing:
            lines.append(odom(0.5 * k, x, y))
        if k % 2 == 1:
            y += 0.3
            lines.append(flaser_of_carmen_logs(0.5 * k, SCAN, (x, y, 0)))
            if k != without_own:
                lines.append(odom(0.5 * k, x, y))
    return [*lines, "NEFF 1\n"]


@pytest.mark.parametrize("name", ["run.log", "run.clf", "run.log.gz"])
def test_scans_odometry_and_stamps_are_read(tmp_path, name):
    lines = [
        "# a remark\n",
        "PARAM robot_frontlaser_offset 0.25 nohost 0\n",
        flaser_of_carmen_logs(1.5, SCAN, odometry=(0, 0, 0)),
        odom(2.0, 0.4),
        flaser_of_carmen_logs(2.5, SCAN, odometry=(1, 0, 0.5)),
    ]
    log = read_of_carmen_logs(tmp_path, *lines, name=name)
    assert log.stamps.tolist() == [1.5, 2.5]
    assert log.odometry.tolist() == [[0, 0, 0], [1, 0, 0.5]]
    assert log.laser_pose.tolist() == [0.25, 0.0, 0.0]
    assert log.ranges[0].tolist() == [1.0, 2.0, 3.0, 4.0, math.inf]
    assert log.geometry.field_of_view == pytest.approx(math.pi)
    assert log.readings_stamps.tolist() == [2.0]
    assert log.reading_of_scan.tolist() == [-1, 0]
    assert log.corrected is None
    assert not log.skipped


def test_old_lines_end_after_the_stamp(tmp_path):
    log = read_of_carmen_logs(
        tmp_path,
        flaser_of_carmen_logs(1.0, SCAN, end=""),
        flaser_of_carmen_logs(2.0, SCAN, (1, 0, 0), end=""),
    )
    assert log.stamps.tolist() == [1.0, 2.0]


def test_new_lines_say_themselves_how_the_laser_looks_and_where_it_is(tmp_path):
    log = read_of_carmen_logs(
        tmp_path, robotlaser(1.0, [1.0, 8.0, 2.0]), robotlaser(2.0, [1.0, 8.0, 2.0], (1.1, 0, 0), (1, 0, 0))
    )
    assert log.geometry == ScanGeometry(beams=3, field_of_view=math.pi, range_min=0.0, range_max=8.0)
    assert log.ranges[0].tolist() == [1.0, math.inf, 2.0]
    assert log.laser_pose == pytest.approx([0.1, 0.0, 0.0])
    assert log.odometry[1].tolist() == [1.0, 0.0, 0.0]


def test_of_corrected_logs_odometry_is_the_sum_of_motions_and_never_the_correction(tmp_path):
    lines = [
        odom(1.0),
        flaser_of_carmen_logs(1.0, SCAN, (9, 9, 1)),
        odom(0, 9, 9, 1),
        odom(1.5, 9 + math.cos(1), 9 + math.sin(1), 1),
        flaser_of_carmen_logs(1.5, SCAN, (7, 7, 0)),
        "NEFF 1\n",
    ]
    log = read_of_carmen_logs(tmp_path, *lines)
    assert log.odometry == pytest.approx(np.array([[0, 0, 0], [1, 0, 0]]), abs=1e-12)
    assert log.corrected.tolist() == [[9, 9, 1], [7, 7, 0]]
    assert log.readings_stamps.tolist() == [1.0, 1.5]
    assert log.reading_of_scan.tolist() == [0, 1]


def test_a_corrected_log_without_readings_between_has_no_odometry(tmp_path):
    lines = []
    for k in range(6):
        lines += [flaser_of_carmen_logs(k, SCAN, (k, 0, 0)), odom(0, k), "NEFF 1\n"]
    log = read_of_carmen_logs(tmp_path, *lines)
    assert log.odometry is None
    assert len(log.readings) == 0


def test_odometry_that_stands_still_is_none(tmp_path):
    assert read_of_carmen_logs(tmp_path, *(flaser_of_carmen_logs(k, SCAN) for k in range(4))).odometry is None


def test_what_cannot_be_used_is_left_out_and_counted(tmp_path):
    lines = [
        flaser_of_carmen_logs(1.0, SCAN),
        flaser_of_carmen_logs(2.0, SCAN, (1, 0, 0)),
        "LASER_READING 3 1 2 3\n",
        flaser_of_carmen_logs(1.5, SCAN, (1, 0, 0)),
        flaser_of_carmen_logs(3.0, SCAN[:3], (1, 0, 0)),
        "FLASER 5 1.0 2.0\n",
        "FLASER five\n",
        "ODOM 1 2\n",
        "FLASER 2 1.0 nan 0 0 0 0 0 nan 4.0 host 4.0\n",
        "\x00\x01\n",
        flaser_of_carmen_logs(4.0, SCAN, (2, 0, 0)),
        flaser_of_carmen_logs(5.0, SCAN, (3, 0, 0)),
    ]
    log = read_of_carmen_logs(tmp_path, *lines)
    assert log.stamps.tolist() == [1.0, 1.5, 2.0, 4.0, 5.0]
    assert log.skipped == {
        "damaged LASER_READING lines": 1,
        "damaged FLASER lines": 3,
        "damaged ODOM lines": 1,
        "\x00\x01 lines": 1,
        "scans that have not 5 beams as most": 1,
    }


def test_a_clock_that_stands_still_is_replaced(tmp_path):
    log = read_of_carmen_logs(tmp_path, *(flaser_of_carmen_logs(7.0, SCAN, (k, 0, 0)) for k in range(4)))
    assert log.stamps.tolist() == [0.0, 1.0, 2.0, 3.0]
    assert any("numbered" in reason for reason in log.skipped)


def test_of_a_log_that_is_cut_off_the_rest_is_used(tmp_path):
    whole = gzip.compress(
        "".join(
            flaser_of_carmen_logs(k, np.random.default_rng(k).random(60).round(3).tolist(), (k, 0, 0))
            for k in range(200)
        ).encode()
    )
    (tmp_path / "cut.log.gz").write_bytes(whole[: len(whole) // 2])
    log = read_carmen_log(tmp_path / "cut.log.gz")
    assert 20 < len(log.stamps) < 200
    assert any("cut off" in reason for reason in log.skipped)


@pytest.mark.parametrize(
    "content", [b"", b"ODOM 0 0 0 0 0 0 1 host 1\n", b"\x1f\x8b no gzip", b"FLASER 0 0 0 0 0 0 0 1 h 1\n"]
)
def test_a_log_without_scans_is_refused(tmp_path, content):
    for name in ("run.log", "run.log.gz"):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(ValueError, match="no scans"):
            read_carmen_log(tmp_path / name)


def test_odometry_of_a_scan_without_a_line_of_its_stamp_is_interpolated(tmp_path):
    whole, gaps = (
        read_of_carmen_logs(tmp_path, *corrected_lines()),
        read_of_carmen_logs(tmp_path, *corrected_lines(missing=(5, 8))),
    )
    assert whole.odometry[:, 0] == pytest.approx(0.2 + 0.4 * np.arange(6))
    assert whole.odometry[:, 1] == pytest.approx(np.zeros(6), abs=1e-9)
    assert gaps.stamps.tolist() == whole.stamps.tolist()
    # The third scan's reading is missing; the last one before it is not repeated.
    assert np.diff(gaps.odometry[:, 0]).min() > 0.1


def test_a_pose_of_the_program_that_is_missing_costs_nothing(tmp_path):
    whole, without = (read_of_carmen_logs(tmp_path, *corrected_lines(without_own=own)) for own in (None, 5))
    assert without.odometry == pytest.approx(whole.odometry, abs=1e-9)


def test_a_number_of_remissions_behind_the_ranges_is_passed_over():
    plain = said(FLASER).scans[0][0]
    for numbers in ("0", "2 7 8"):
        ((scan, _),) = said(FLASER.replace("3.0 0.5", f"3.0 {numbers} 0.5")).scans
        assert (scan.ranges, scan.laser_pose, scan.robot_pose) == (plain.ranges, plain.laser_pose, plain.robot_pose)
        assert scan.stamp == plain.stamp


def test_readings_of_gmapping_have_odometry_as_measured(tmp_path):
    lines = []
    for k in range(6):
        lines += [
            odom(float(k), 5.0 + 0.1 * k),
            f"LASER_READING 5 {' '.join(map(str, SCAN))} {5.0 + 0.1 * k} 0 0 {k}\n",
        ]
        lines += ["SM_UPDATE 30 1 2 3\n", "NEFF 30\n"]
    log = read_of_carmen_logs(tmp_path, *lines)
    assert log.odometry[:, 0] == pytest.approx(5.0 + 0.1 * np.arange(6))
    assert log.corrected is None
    assert not log.skipped


def test_lines_that_repeat_a_scan_without_its_directions_are_left_out(tmp_path):
    ranges = [1.0, 8.0, 2.0]
    lines = [
        each
        for k in range(5)
        for each in (flaser_of_carmen_logs(float(k), ranges, (0.1 * k, 0, 0)), robotlaser(float(k), ranges))
    ]
    log = read_of_carmen_logs(tmp_path, *lines)
    assert log.stamps.tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]
    assert log.skipped == {"FLASER lines that repeat ROBOTLASER1 lines": 5}
    assert log.geometry.range_max == 8.0


def test_ranges_in_centimetres_are_refused(tmp_path):
    ranges = np.random.default_rng(0).uniform(50.0, 700.0, 90).round(1).tolist()
    with pytest.raises(ValueError, match="as of ranges in centimetres; want metres"):
        read_of_carmen_logs(tmp_path, *(flaser_of_carmen_logs(k, ranges, (k, 0, 0)) for k in range(3)))


@pytest.mark.parametrize("scale", [1.0, -1.0, 180.0 / math.pi], ids=["radians", "clockwise", "degrees"])
@pytest.mark.parametrize("start", [0.5, 2.6])
def test_a_mounting_is_in_the_axes_that_odometry_shows(scale, start, tmp_path):
    draws, mounting = np.random.default_rng(0), np.array([0.3, 0.1, 0.2])
    pose, lines = np.array([10.0, 4.0, start]), []
    for k in range(120):
        pose = composed(pose, np.array([0.1, 0.0, 0.03]))
        laser = composed(pose, mounting)
        ranges = " ".join(f"{each:.2f}" for each in draws.uniform(1.0, 4.0, 181))
        poses = " ".join(f"{x:.6f} {y:.6f} {scale * theta:.6f}" for x, y, theta in (laser, pose))
        lines.append(f"FLASER 181 {ranges} {poses} {0.1 * k:.1f} host {0.1 * k:.1f}\n")
    (tmp_path / "log.log").write_text("".join(lines))
    np.testing.assert_allclose(read_carmen_log(tmp_path / "log.log").laser_pose, mounting, atol=1e-4)


def test_a_packed_log_of_any_name_is_read(tmp_path):
    (tmp_path / "packed.log").write_bytes(gzip.compress(flaser(1.0, [2.0] * 181).encode()))
    assert len(read_carmen_log(tmp_path / "packed.log").stamps) == 1
