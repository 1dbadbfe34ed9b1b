"""A local map of a room, for the tests of matching."""

import numpy as np
from driven_rooms import GEOMETRY, cast, odd_room

from lidarium.mapping.geometry.rigid import composed
from lidarium.mapping.localization.matching.scan_points import scan_points
from lidarium.mapping.localization.matching.submaps import Submap
from lidarium.mapping.localization.settings import SubmapSettings

ORIGIN = np.array([2.5, 1.5, 0.3])
"""The local map's frame in the room."""

SUBMAPS = SubmapSettings(resolution=0.05)


def points_of(ranges):
    """Return few points of a scan in the robot's frame, (n, 2)."""
    return scan_points(ranges, GEOMETRY.unit_vectors, GEOMETRY.angle_increment, 5.6, 0.08, 250)


def odd_room_submap():
    """Return the odd room as seen from places around its middle."""
    submap = Submap(SUBMAPS, 12.0)
    generator = np.random.default_rng(0)
    for offset in generator.uniform(-0.5, 0.5, (8, 3)):
        pose = composed(ORIGIN, offset)
        assert submap.insert(offset, cast(odd_room(), pose), GEOMETRY, 20.0)
    return submap
