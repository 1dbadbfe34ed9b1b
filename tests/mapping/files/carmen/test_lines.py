"""What the lines of a CARMEN log say."""

import math

import pytest

from lidarium.mapping.files.carmen.lines import Content, parameter, read_line

FLASER = "FLASER 3 1.0 2.0 3.0 0.5 0.6 0.1 0.4 0.5 0.2 12.5 host 12.6"
ROBOTLASER = (
    "ROBOTLASER1 0 -1.0 2.0 1.0 30.0 0.1 0 3 1.0 2.0 3.0 1 9 0.5 0.6 0.1 0.4 0.5 0.2 1 2 3 4 5 13.5 host 13.6"
)


def said(*lines):
    content = Content()
    for line in lines:
        read_line(line, content)
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


def test_odometry_is_stamped_by_the_logger_or_else_by_the_last_word():
    content = said("ODOM 1 2 0.5 0.1 0.2 0.3 7.5 host 7.6", "ODOM 1 2 0.5 8.5")
    assert content.odometry == [([1.0, 2.0, 0.5], 7.6), ([1.0, 2.0, 0.5], 8.5)]


def test_parameters_are_numbers_or_none():
    content = said("PARAM laser_fov 180 1 host 1", "PARAM laser_name sick 1", "PARAM laser_max inf 1")
    assert parameter(content, "laser_fov") == 180.0
    for name in ("laser_name", "laser_max", "laser_other"):
        assert parameter(content, name) is None


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
