import math

import numpy as np
import pytest
from driven_rooms import GEOMETRY, box, cast, odd_room

from lidarium.mapping.localization.closures import ClosureFinder
from lidarium.mapping.localization.local_mapping import Finished
from lidarium.mapping.localization.scan_points import scan_points
from lidarium.mapping.localization.settings import ClosureSettings, MatchingSettings, SubmapSettings
from lidarium.mapping.localization.submaps import Submap
from lidarium.mapping.rigid import composed

KNOWN = np.diag([0.05**2, 0.05**2, math.radians(1.0) ** 2])
"""How well the pose is known when the robot comes back."""


def finder_of(walls, poses):
    """Return a finder that knows one local map, seen from poses in its frame; it ended long ago."""
    submap = Submap(SubmapSettings(), 12.0)
    for pose in poses:
        assert submap.insert(pose, cast(walls, pose), GEOMETRY, 20.0)
    finder = ClosureFinder(ClosureSettings(), MatchingSettings())
    finder.remember(Finished(submap.finished(), 0), 0, 0.0)
    return finder


def closures_of(finder, walls, true, believed):
    """Return what a scan taken at a true pose finds where the robot believes to be at another."""
    points = scan_points(cast(walls, true), GEOMETRY.unit_vectors, GEOMETRY.angle_increment, 5.6, 0.05, 350)
    return finder.find(np.stack([np.zeros(3), believed]), points, KNOWN, 50.0, 0.6)


@pytest.fixture(scope="module")
def room_finder():
    middle = np.array([3.0, 2.2, 0.3])
    offsets = np.random.default_rng(0).uniform(-0.4, 0.4, (10, 3)) * [1.0, 1.0, 4.0]
    return finder_of(odd_room(), middle + offsets)


def test_a_room_is_recognised_from_where_the_robot_believes_to_be(room_finder):
    generator = np.random.default_rng(1)
    errors = []
    for _ in range(1000):
        true = np.array([3.0, 2.2, 0.3]) + generator.uniform(-1.0, 1.0, 3) * [0.2, 0.2, 0.3]
        believed = true + generator.uniform(-1.0, 1.0, 3) * [0.2, 0.2, 0.05]
        errors += [closure.measured - true for closure in closures_of(room_finder, odd_room(), true, believed)]
    # Now and then a scan slides into a place that agrees a little less well, or finds none that is sure.
    distances, turns = np.hypot(*np.array(errors)[:, :2].T), np.abs(np.array(errors)[:, 2])
    assert np.sum((distances < 0.03) & (turns < math.radians(0.8))) >= 985
    assert np.percentile(distances, 95) < 0.005
    assert np.percentile(turns, 95) < math.radians(0.1)
    assert distances.max() < 0.04
    assert turns.max() < math.radians(1.5)


@pytest.mark.parametrize("thickness", [0.1, 0.15, 0.2, 0.25])
def test_the_other_side_of_a_wall_is_not_taken_for_the_one_that_the_map_knows(thickness):
    walls = np.array([(0.0, 1.0, 8.0, 1.0), (0.0, 1.0 + thickness, 8.0, 1.0 + thickness), (3.0, -1.0, 3.0, 1.0), (5.0, -1.0, 5.0, 1.0)])
    below = [np.array([x, y, math.pi / 2]) for x in (3.6, 4.0, 4.4) for y in (-0.4, 0.0, 0.4)]
    above = np.array([4.0, 2.4, -math.pi / 2])
    finder = finder_of(walls, below)
    assert closures_of(finder, walls, above, above) == []
    # From below the same wall is recognised.
    assert len(closures_of(finder, walls, below[4], composed(below[4], np.array([0.05, 0.05, 0.01])))) == 1


def test_what_was_moved_in_a_corridor_does_not_move_the_robot():
    def corridor(x):
        return np.concatenate([box(-6.0, 0.0, 20.0, 2.0), box(x, 1.5, 0.25, 0.25)])

    places = [np.array([x, y, 0.0]) for x in (3.2, 3.5, 3.8) for y in (0.7, 0.9, 1.1)]
    finder = finder_of(corridor(5.0), places)
    (closure,) = closures_of(finder, corridor(5.2), places[4], places[4])
    # The box, moved by 0.2 m, is all that tells where along the corridor the robot is.
    assert np.hypot(*(closure.measured - places[4])[:2]) < 0.1
