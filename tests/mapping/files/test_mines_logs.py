"""Logs of the rover of Mines ParisTech."""

import math

import numpy as np
import pytest

from lidarium.mapping.files.log_files import read_log


def row(time_us, left, right, ranges):
    return " ".join(map(str, [time_us, 0, left, right, *[0] * 20, *ranges, 5]))


def test_counts_of_wheels_are_motions_and_millimetres_metres(tmp_path):
    ranges = np.full(682, 1500)
    ranges[[0, 1, 2]] = 0, 19, 5700
    lines = [row(100_000 * k, 100 * k, 100 * k, ranges) for k in range(10)]
    lines[5:5] = ["# damaged", row(1, 2, 3, ranges[:-1])]
    (tmp_path / "run.dat").write_text("\n".join(lines) + "\n")
    log = read_log(tmp_path / "run.dat")
    assert log.skipped == {"damaged lines": 2}
    seen = log.ranges[0]
    assert np.isnan(seen[:2]).all()
    assert np.isinf(seen[2])
    assert (seen[3:] == 1.5).all()
    assert math.degrees(log.geometry.field_of_view) == pytest.approx(240.0)
    # A twentieth of a turn of a wheel of 77 mm in 0.1 s; a scan is 0.15 s older than the counts.
    step = 0.05 * 2.0 * math.pi * 0.077
    assert log.odometry[4:, 0] == pytest.approx(step * (np.arange(4, 10) - 1.5))
    assert np.abs(log.odometry[:, 1:]).max() == 0.0


def test_wheels_that_turn_against_each_other_turn_the_robot(tmp_path):
    lines = [row(100_000 * k, -100 * k, 100 * k, np.full(682, 900)) for k in range(5)]
    (tmp_path / "run.dat").write_text("\n".join(lines))
    odometry = read_log(tmp_path / "run.dat").odometry
    assert np.diff(odometry[:, 2])[-1] == pytest.approx(0.05 * 2.0 * math.pi * 0.077 / 0.165)


def test_a_file_without_such_lines_is_refused(tmp_path):
    (tmp_path / "run.dat").write_text("1 2 3\n")
    with pytest.raises(ValueError, match=r"run.dat holds no scans; want lines of 707 numbers"):
        read_log(tmp_path / "run.dat")
