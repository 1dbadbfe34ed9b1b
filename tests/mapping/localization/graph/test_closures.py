import math

import numpy as np
import pytest
from driven_rooms import GEOMETRY, box, cast, odd_room

from lidarium.mapping.geometry.rigid import composed, relative
from lidarium.mapping.localization.graph.closures import ClosureFinder
from lidarium.mapping.localization.matching.local_mapping import Finished
from lidarium.mapping.localization.matching.scan_points import scan_points
from lidarium.mapping.localization.matching.submaps import Submap
from lidarium.mapping.localization.settings import ClosureSettings, MatchingSettings, SubmapSettings

KNOWN = np.diag([0.05**2, 0.05**2, math.radians(1.0) ** 2])
"""How well the pose is known when the robot comes back."""

SINCE = np.diag([0.3**2, 0.3**2, math.radians(5.0) ** 2])
"""How well it is known as seen from where the local map was made."""


def map_of(walls, poses, nodes=(0,), places=((0.0, 0.0, 0.0),)):
    """Return a finished local map, seen from poses in its frame, with nodes at places in it."""
    submap = Submap(SubmapSettings(), 12.0)
    for pose in poses:
        assert submap.insert(pose, cast(walls, pose), GEOMETRY, 20.0)
    return Finished(submap.finished(), np.array(nodes), np.array(places))


def finder_of(walls, poses, **settings):
    """Return a finder that knows one local map, seen from poses in its frame; it ended long ago."""
    finder = ClosureFinder(ClosureSettings(**settings), MatchingSettings())
    finder.remember(map_of(walls, poses), 0.0)
    return finder


def closures_of(finder, walls, true, believed, nodes=((0.0, 0.0, 0.0),), since=SINCE):
    """Return what a scan taken at a true pose finds where the robot believes to be at another."""
    points = scan_points(cast(walls, true), GEOMETRY.unit_vectors, GEOMETRY.angle_increment, 5.6, 0.05, 350)
    return finder.find(np.array([*nodes, believed]), points, KNOWN, lambda _node: since, 50.0, 0.6)


@pytest.fixture(scope="module")
def middle():
    return np.array([3.0, 2.2, 0.3])


@pytest.fixture(scope="module")
def around_middle(middle):
    return middle + np.random.default_rng(0).uniform(-0.4, 0.4, (10, 3)) * [1.0, 1.0, 4.0]


@pytest.fixture(scope="module")
def room_finder(around_middle):
    # It tells at once what it recognises, however far that would move the robot.
    return finder_of(odd_room(), around_middle, confirmed_beyond_m=1.0)


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
    walls = np.array(
        [
            (0.0, 1.0, 8.0, 1.0),
            (0.0, 1.0 + thickness, 8.0, 1.0 + thickness),
            (3.0, -1.0, 3.0, 1.0),
            (5.0, -1.0, 5.0, 1.0),
        ]
    )
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


def test_a_move_that_the_way_since_makes_improbable_waits_for_another_local_map(middle, around_middle):
    aside, surely = np.array([0.15, 0.1, 0.0]), np.diag([0.02**2, 0.02**2, math.radians(0.5) ** 2])
    finder, nodes = finder_of(odd_room(), around_middle), ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    assert closures_of(finder, odd_room(), middle, middle + aside, nodes, surely) == []
    # However many scans say so: all of them see one local map, which may be of another place.
    for x in (0.05, -0.05, 0.1):
        true = middle + np.array([x, 0.0, 0.0])
        assert closures_of(finder, odd_room(), true, true + aside, nodes, surely) == []
    # A second local map, whose node is nearer now, is another witness.
    finder.remember(map_of(odd_room(), around_middle, nodes=(1,), places=nodes[1:]), 0.0)
    closures = closures_of(finder, odd_room(), middle, middle + aside, nodes, surely)
    assert {closure.old for closure in closures} == {0, 1}
    assert len(closures) >= ClosureSettings().confirmations


@pytest.mark.parametrize(("distance", "waits"), [(0.1, False), (0.16, True), (0.2, True)])
def test_a_move_as_long_as_walls_are_thick_waits_for_another_local_map_however_far_the_robot_may_have_erred(
    middle, around_middle, distance, waits
):
    finder, nodes, aside = (
        finder_of(odd_room(), around_middle),
        ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0)),
        np.array([distance, 0.0, 0.0]),
    )
    anywhere = np.diag([2.0**2, 2.0**2, math.radians(5.0) ** 2])
    for x in (0.0, 0.05, -0.05):
        true = middle + np.array([x, 0.0, 0.0])
        assert (closures_of(finder, odd_room(), true, true + aside, nodes, anywhere) == []) == waits
    finder.remember(map_of(odd_room(), around_middle, nodes=(1,), places=nodes[1:]), 0.0)
    found = closures_of(finder, odd_room(), middle, middle + aside, nodes, anywhere)
    assert len(found) == (4 if waits else 1)


@pytest.mark.parametrize(("apart", "confirms"), [(0.05, True), (0.16, False)])
def test_closures_that_lie_apart_by_the_thickness_of_a_wall_do_not_confirm_each_other(
    middle, around_middle, apart, confirms
):
    finder, nodes, aside = (
        finder_of(odd_room(), around_middle),
        ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0)),
        np.array([0.16, 0.0, 0.0]),
    )
    anywhere = np.diag([2.0**2, 2.0**2, math.radians(5.0) ** 2])
    for x in (0.0, 0.05, -0.05):
        true = middle + np.array([x, 0.0, 0.0])
        assert closures_of(finder, odd_room(), true, true + aside, nodes, anywhere) == []
    # The second local map lies aside of where its node is believed to be.
    finder.remember(map_of(odd_room(), around_middle, nodes=(1,), places=((1.0, apart, 0.0),)), 0.0)
    assert bool(closures_of(finder, odd_room(), middle, middle + aside, nodes, anywhere)) == confirms


def test_a_closure_is_seen_from_the_nearest_node_of_a_local_map_that_is_bent(middle, around_middle):
    # On the way from the first node to the third the local map has become too long by 0.2 m; what is near the
    # third lies right to it.
    places = np.array([(-4.0, 2.0, 0.0), (0.0, 2.0, 0.1), middle - [0.5, 0.0, 0.0]])
    finder = ClosureFinder(ClosureSettings(), MatchingSettings())
    finder.remember(map_of(odd_room(), around_middle, nodes=(0, 1, 2), places=places), 0.0)
    nodes = places + np.array([0.2, 0.1, 0.0])[:, None] * [1.0, 0.0, 0.0]
    (closure,) = closures_of(finder, odd_room(), middle, middle + np.array([0.03, -0.02, 0.01]), nodes)
    assert (closure.old, closure.new) == (2, 3)
    assert closure.measured == pytest.approx(relative(places[2], middle), abs=0.02)
