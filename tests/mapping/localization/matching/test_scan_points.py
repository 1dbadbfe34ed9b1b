"""Points that stand for a scan."""

import math

import numpy as np
import pytest
from driven_rooms import GEOMETRY, cast, odd_room

from lidarium.mapping.geometry.rigid import composed, relative
from lidarium.mapping.grids.scan_geometry import ScanGeometry
from lidarium.mapping.localization.matching.scan_points import at_last_beam, scan_points

ORIGIN = np.array([2.5, 1.5, 0.3])


def points_of(ranges):
    return scan_points(ranges, GEOMETRY.unit_vectors, GEOMETRY.angle_increment, 5.6, 0.08, 250)


@pytest.mark.parametrize("motion", [(0.15, 0.0, 0.0), (0.1, 0.02, 0.3), (0.0, 0.0, -0.4)])
def test_motion_within_a_scan_is_undone(motion):
    motion, walls = np.array(motion), odd_room()
    geometry = ScanGeometry(beams=361, field_of_view=2.0 * math.pi, range_max=8.0)
    beams = geometry.beams
    start = relative(motion, np.zeros(3))
    skewed = np.empty(beams, np.float32)
    for beam in range(beams):
        # At constant speed and turn rate the pose follows an arc; chords of a tenth are near enough to it.
        share = beam / (beams - 1)
        turn, half = motion[2] * share, 0.5 * motion[2]
        along = relative(np.array([0.0, 0.0, half]), motion)[:2] * share
        then = np.array([*composed(np.array([0.0, 0.0, 0.5 * turn]), np.array([*along, 0.0]))[:2], turn])
        skewed[beam] = cast(walls, composed(ORIGIN, composed(start, then)), geometry)[beam]
    straight = at_last_beam(skewed, geometry, motion, 1.0 / (beams - 1), 1.0)
    true = cast(walls, ORIGIN, geometry)
    both = np.isfinite(straight) & np.isfinite(true)
    assert both.mean() > 0.8
    assert np.median(np.abs(straight - true)[both]) < 0.02
    assert np.median(np.abs(skewed - true)) > 0.03


def test_a_scan_taken_at_once_is_left_as_it_is():
    ranges = np.full(GEOMETRY.beams, 2.0, np.float32)
    assert at_last_beam(ranges, GEOMETRY, np.ones(3), 0.0, 0.1) is ranges
    assert at_last_beam(ranges, GEOMETRY, np.zeros(3), 0.001, 0.1) is ranges


def test_few_points_stand_for_all():
    near, far = np.full(GEOMETRY.beams, 1.0, np.float32), np.full(GEOMETRY.beams, 5.0, np.float32)
    points = points_of(near)
    assert 40 < len(points) < 70
    assert np.hypot(*np.diff(points, axis=0).T).min() > 0.07
    assert len(points_of(far)) == GEOMETRY.beams
    assert len(scan_points(far, GEOMETRY.unit_vectors, GEOMETRY.angle_increment, 20.0, 0.01, 100)) == 100
    assert len(scan_points(far, GEOMETRY.unit_vectors, GEOMETRY.angle_increment, 4.0, 0.01, 100)) == 0
