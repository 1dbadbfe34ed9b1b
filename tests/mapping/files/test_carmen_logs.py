"""Logs of CARMEN: scans, odometry and stamps of their lines."""

import gzip
import math

import numpy as np
import pytest

from lidarium.mapping.files.carmen_logs import read_carmen_log
from lidarium.mapping.grids.scan_geometry import ScanGeometry


def flaser(stamp, ranges, pose=(0.0, 0.0, 0.0), odometry=None, end="host 0"):
    numbers = [len(ranges), *ranges, *pose, *(odometry or pose), stamp]
    return f"FLASER {' '.join(map(str, numbers))} {end}\n"


def odom(stamp, x=0.0, y=0.0, theta=0.0):
    return f"ODOM {x} {y} {theta} 0 0 0 {stamp} host {stamp}\n"


def robotlaser(stamp, ranges, laser=(0.1, 0.0, 0.0), robot=(0.0, 0.0, 0.0), max_range=8.0):
    step = math.pi / (len(ranges) - 1)
    head = (
        f"ROBOTLASER1 0 {-math.pi / 2} {math.pi} {step} {max_range} 0.01 0 {len(ranges)} "
        f"{' '.join(map(str, ranges))}"
    )
    return f"{head} 0 {' '.join(map(str, (*laser, *robot)))} 0 0 0.1 0.1 0 {stamp} host {stamp}\n"


SCAN = [1.0, 2.0, 3.0, 4.0, 5.0]


def read(tmp_path, *lines, name="run.log"):
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
            lines.append(flaser(0.5 * k, SCAN, (x, y, 0)))
            if k != without_own:
                lines.append(odom(0.5 * k, x, y))
    return [*lines, "NEFF 1\n"]


@pytest.mark.parametrize("name", ["run.log", "run.clf", "run.log.gz"])
def test_scans_odometry_and_stamps_are_read(tmp_path, name):
    lines = [
        "# a remark\n",
        "PARAM robot_frontlaser_offset 0.25 nohost 0\n",
        flaser(1.5, SCAN, odometry=(0, 0, 0)),
        odom(2.0, 0.4),
        flaser(2.5, SCAN, odometry=(1, 0, 0.5)),
    ]
    log = read(tmp_path, *lines, name=name)
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
    log = read(tmp_path, flaser(1.0, SCAN, end=""), flaser(2.0, SCAN, (1, 0, 0), end=""))
    assert log.stamps.tolist() == [1.0, 2.0]


def test_new_lines_say_themselves_how_the_laser_looks_and_where_it_is(tmp_path):
    log = read(
        tmp_path, robotlaser(1.0, [1.0, 8.0, 2.0]), robotlaser(2.0, [1.0, 8.0, 2.0], (1.1, 0, 0), (1, 0, 0))
    )
    assert log.geometry == ScanGeometry(beams=3, field_of_view=math.pi, range_min=0.0, range_max=8.0)
    assert log.ranges[0].tolist() == [1.0, math.inf, 2.0]
    assert log.laser_pose == pytest.approx([0.1, 0.0, 0.0])
    assert log.odometry[1].tolist() == [1.0, 0.0, 0.0]


def test_of_corrected_logs_odometry_is_the_sum_of_motions_and_never_the_correction(tmp_path):
    lines = [
        odom(1.0),
        flaser(1.0, SCAN, (9, 9, 1)),
        odom(0, 9, 9, 1),
        odom(1.5, 9 + math.cos(1), 9 + math.sin(1), 1),
        flaser(1.5, SCAN, (7, 7, 0)),
        "NEFF 1\n",
    ]
    log = read(tmp_path, *lines)
    assert log.odometry == pytest.approx(np.array([[0, 0, 0], [1, 0, 0]]), abs=1e-12)
    assert log.corrected.tolist() == [[9, 9, 1], [7, 7, 0]]
    assert log.readings_stamps.tolist() == [1.0, 1.5]
    assert log.reading_of_scan.tolist() == [0, 1]


def test_a_corrected_log_without_readings_between_has_no_odometry(tmp_path):
    lines = []
    for k in range(6):
        lines += [flaser(k, SCAN, (k, 0, 0)), odom(0, k), "NEFF 1\n"]
    log = read(tmp_path, *lines)
    assert log.odometry is None
    assert len(log.readings) == 0


def test_odometry_that_stands_still_is_none(tmp_path):
    assert read(tmp_path, *(flaser(k, SCAN) for k in range(4))).odometry is None


def test_what_cannot_be_used_is_left_out_and_counted(tmp_path):
    lines = [
        flaser(1.0, SCAN),
        flaser(2.0, SCAN, (1, 0, 0)),
        "LASER_READING 3 1 2 3\n",
        flaser(1.5, SCAN, (1, 0, 0)),
        flaser(3.0, SCAN[:3], (1, 0, 0)),
        "FLASER 5 1.0 2.0\n",
        "FLASER five\n",
        "ODOM 1 2\n",
        "FLASER 2 1.0 nan 0 0 0 0 0 nan 4.0 host 4.0\n",
        "\x00\x01\n",
        flaser(4.0, SCAN, (2, 0, 0)),
        flaser(5.0, SCAN, (3, 0, 0)),
    ]
    log = read(tmp_path, *lines)
    assert log.stamps.tolist() == [1.0, 2.0, 4.0, 5.0]
    assert log.skipped == {
        "LASER_READING lines": 1,
        "damaged FLASER lines": 3,
        "damaged ODOM lines": 1,
        "\x00\x01 lines": 1,
        "scans that have not 5 beams as most": 1,
        "scans back in time": 1,
    }


def test_a_clock_that_stands_still_is_replaced(tmp_path):
    log = read(tmp_path, *(flaser(7.0, SCAN, (k, 0, 0)) for k in range(4)))
    assert log.stamps.tolist() == [0.0, 1.0, 2.0, 3.0]
    assert any("numbered" in reason for reason in log.skipped)


def test_of_a_log_that_is_cut_off_the_rest_is_used(tmp_path):
    whole = gzip.compress(
        "".join(
            flaser(k, np.random.default_rng(k).random(60).round(3).tolist(), (k, 0, 0)) for k in range(200)
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
    whole, gaps = read(tmp_path, *corrected_lines()), read(tmp_path, *corrected_lines(missing=(5, 8)))
    assert whole.odometry[:, 0] == pytest.approx(0.2 + 0.4 * np.arange(6))
    assert whole.odometry[:, 1] == pytest.approx(np.zeros(6), abs=1e-9)
    assert gaps.stamps.tolist() == whole.stamps.tolist()
    # The third scan's reading is missing; the last one before it is not repeated.
    assert np.diff(gaps.odometry[:, 0]).min() > 0.1


def test_a_pose_of_the_program_that_is_missing_costs_nothing(tmp_path):
    whole, without = (read(tmp_path, *corrected_lines(without_own=own)) for own in (None, 5))
    assert without.odometry == pytest.approx(whole.odometry, abs=1e-9)
