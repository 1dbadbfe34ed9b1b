"""Points of scans lie where their beams saw them."""

import numpy as np
import pytest
from polygon_scans import scan
from scanned_walls import LASER

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.splines.curves.settings import PointSettings
from lidarium.mapping.splines.scan_points import scan_points


def test_each_beam_is_placed_where_it_was_seen_at_its_own_time():
    wall = np.array([(3.0, -4.0, 3.0, 4.0)])
    interval, speed, turn = 0.0001, 1.0, 0.8
    ranges = np.empty(LASER.beams, np.float32)
    duration = interval * (LASER.beams - 1)
    poses = [Transform(speed * interval * k, 0.0, turn * interval * k) for k in range(LASER.beams)]
    for k, pose in enumerate(poses):
        ranges[k] = scan(wall, (pose.x, pose.y, pose.theta), LASER)[k]
    still = scan_points(ranges, LASER)
    moving = scan_points(
        ranges, LASER, PointSettings(beam_interval_s=interval), poses[0].inverse() @ poses[-1], duration
    )
    placed, unplaced = (poses[-1].apply(points.points) for points in (moving, still))
    assert np.abs(placed[:, 0] - 3.0).max() < 0.002
    assert np.abs(unplaced[:, 0] - 3.0).max() > 0.05


def test_a_scan_of_another_laser_is_refused():
    with pytest.raises(ValueError, match="727 beams"):
        scan_points(np.ones(10, np.float32), LASER)
