"""Scans are placed in submaps: within a window, everywhere, and by odometry where walls hold nothing."""

import math

import numpy as np
import pytest
from driven_rooms import GEOMETRY, cast, odd_room
from hypothesis import given, settings
from hypothesis import strategies as st
from mapped_room import ORIGIN, SUBMAPS, odd_room_submap, points_of

from lidarium.mapping.geometry.rigid import composed
from lidarium.mapping.localization.matching.branch_and_bound import place, pyramid
from lidarium.mapping.localization.matching.scan_matching import refine
from lidarium.mapping.localization.matching.scan_search import search
from lidarium.mapping.localization.matching.submaps import Submap

NOTHING_KNOWN = np.zeros((3, 3))


@pytest.fixture(scope="module")
def submap():
    """The odd room as seen from places around its middle."""
    return odd_room_submap()


offsets = st.tuples(st.floats(-0.4, 0.4), st.floats(-0.4, 0.4), st.floats(-0.25, 0.25))
errors = st.tuples(st.floats(-0.2, 0.2), st.floats(-0.2, 0.2), st.floats(-0.15, 0.15))


@settings(max_examples=25)
@given(offset=offsets, error=errors)
def test_a_scan_is_laid_where_it_was_taken_from_anywhere_within_the_window(submap, offset, error):
    true = np.array(offset)
    points = points_of(cast(odd_room(), composed(ORIGIN, true)))
    predicted = true + np.array(error)
    start = search(submap.grid, points, predicted, 0.25, 0.2, NOTHING_KNOWN, 500.0, 0.3)
    match = refine(submap.grid, points, start, start, np.zeros((3, 3)), 500.0, 0.3)
    assert np.hypot(*(match.pose - true)[:2]) < 0.015
    assert abs(match.pose[2] - true[2]) < math.radians(0.4)
    assert match.score > 0.6
    assert match.contradiction < 0.02


def test_no_points_match_nowhere(submap):
    nothing = np.zeros((0, 2))
    assert search(submap.grid, nothing, np.ones(3), 0.2, 0.1, NOTHING_KNOWN, 500.0, 0.3).tolist() == [
        1.0,
        1.0,
        1.0,
    ]
    assert refine(submap.grid, nothing, np.ones(3), np.ones(3), np.eye(3), 1.0, 0.3).score == 0.0
    assert place(pyramid(submap.finished()), nothing, np.zeros(3), (1.0, 1.0), 0.1, 100) == (None, True)


def test_the_covariance_grows_along_a_bare_corridor():
    walls = np.array([(-30, -1, 30, -1), (-30, 1, 30, 1)], float)
    submap = Submap(SUBMAPS, 12.0)
    for x in (0.0, 0.2, 0.4):
        submap.insert(np.array([x, 0.0, 0.0]), cast(walls, np.array([x, 0.0, 0.0])), GEOMETRY, 20.0)
    points = points_of(cast(walls, np.array([0.3, 0.0, 0.0])))
    covariance = refine(
        submap.grid, points, np.array([0.3, 0, 0]), np.array([0.3, 0, 0]), np.zeros((3, 3)), 500.0, 0.3
    ).covariance
    assert covariance[0, 0] > 10.0 * covariance[1, 1]


def test_odometry_holds_the_pose_where_walls_do_not():
    walls = np.array([(-30, -1, 30, -1), (-30, 1, 30, 1)], float)
    submap = Submap(SUBMAPS, 12.0)
    submap.insert(np.zeros(3), cast(walls, np.zeros(3)), GEOMETRY, 20.0)
    prior = np.array([0.2, 0.03, 0.0])
    match = refine(
        submap.grid,
        points_of(cast(walls, np.array([0.2, 0.0, 0.0]))),
        prior,
        prior,
        np.diag([1e4, 1e2, 1e3]),
        500.0,
        0.3,
    )
    assert match.pose[0] == pytest.approx(0.2, abs=0.02)
    assert match.pose[1] == pytest.approx(0.0, abs=0.01)


def test_a_wall_that_goes_on_beyond_the_map_holds_no_one_back():
    """The map ends soon ahead of where it was made; a scan farther on sees more of the walls than the map
    has."""
    walls = np.array([(-30, -1, 30, -1), (-30, 1, 30, 1)], float)
    submap = Submap(SUBMAPS, 14.0)
    submap.insert(np.zeros(3), cast(walls, np.zeros(3)), GEOMETRY, 3.0)
    predicted = np.array([2.0, 0.02, 0.01])
    points = points_of(cast(walls, np.array([2.0, 0.0, 0.0])))
    information = np.diag([400.0, 400.0, 400.0])
    start = search(submap.grid, points, predicted, 0.3, 0.05, information, 500.0, 0.3)
    match = refine(submap.grid, points, start, predicted, information, 500.0, 0.3)
    assert match.pose[0] == pytest.approx(2.0, abs=0.06)
    assert match.pose[1] == pytest.approx(0.0, abs=0.02)


def test_noise_does_not_turn_scans_against_the_map():
    generator = np.random.default_rng(0)
    turns = []
    for _ in range(80):
        pose = np.array([*generator.uniform(1.5, 3.5, 2), generator.uniform(-3.0, 3.0)])
        scans = [
            cast(odd_room(), pose) + generator.normal(0.0, 0.03, GEOMETRY.beams).astype(np.float32)
            for _ in range(2)
        ]
        submap = Submap(SUBMAPS, 12.0)
        submap.insert(np.zeros(3), scans[0], GEOMETRY, 20.0)
        turns.append(
            refine(
                submap.grid, points_of(scans[1]), np.zeros(3), np.zeros(3), np.zeros((3, 3)), 500.0, 0.3
            ).pose[2]
        )
    assert abs(np.mean(turns)) < 3.0 * np.std(turns) / math.sqrt(len(turns))
