"""Scans of a CARMEN log in the directions of most of them."""

import math

import numpy as np
import pytest

from lidarium.mapping.files.carmen.directions import give_directions, on_one_grid
from lidarium.mapping.files.carmen.lines import Content, Scan


def scan_of(ranges, max_range=math.nan):
    return Scan(list(ranges), 1.0, [0.0] * 3, [0.0] * 3, None, max_range, has_angles=False)


def content_of(*scans, **parameters):
    content = Content(scans=[(scan, 0) for scan in scans])
    content.parameters.update({f"laser_front_laser_{name}": value for name, value in parameters.items()})
    give_directions(content, None)
    return content


def test_the_field_of_view_is_that_of_the_log():
    content = content_of(scan_of([1.0, 2.0, 3.0]), fov="90")
    beams = content.scans[0][0].beams
    assert beams.angle_min == pytest.approx(-math.pi / 4.0)
    assert beams.increment == pytest.approx(math.pi / 4.0)


def test_scans_of_another_number_of_beams_are_left_out_and_counted():
    content = content_of(scan_of([1.0, 2.0, 3.0]), scan_of([1.0, 2.0]), scan_of([4.0, 5.0, 6.0]), fov="90")
    kept, _, ranges, _ = on_one_grid(content)
    assert len(kept) == 2
    np.testing.assert_array_equal(ranges, [[1.0, 2.0, 3.0], [4.0, 5.0, np.inf]])
    assert content.skipped == {"scans that have not 3 beams as most": 1}


def test_the_longest_range_is_no_return_and_what_is_not_above_zero_is_invalid():
    content = content_of(scan_of([5.0, 0.0, 8.0]), scan_of([-1.0, 8.0, math.nan]), fov="90")
    _, _, ranges, longest = on_one_grid(content)
    assert longest == 8.0
    np.testing.assert_array_equal(ranges, [[5.0, np.nan, np.inf], [np.nan, np.inf, np.nan]])


def test_what_the_log_says_of_the_longest_range_counts():
    content = content_of(scan_of([5.0, 30.0, 29.0], max_range=30.0), fov="90")
    _, _, ranges, longest = on_one_grid(content)
    assert longest == 30.0
    np.testing.assert_array_equal(ranges, [[5.0, np.inf, 29.0]])


def test_a_laser_that_gives_eighty_metres_and_more_has_no_return_there():
    content = content_of(scan_of([5.0, 81.91, 80.0]), fov="90")
    _, _, ranges, longest = on_one_grid(content)
    assert longest == 80.0
    np.testing.assert_array_equal(ranges, [[5.0, np.inf, np.inf]])
