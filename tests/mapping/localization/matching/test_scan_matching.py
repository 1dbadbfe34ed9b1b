"""Scans are placed in submaps: within a window, everywhere, and by odometry where walls hold nothing."""

import math

import numpy as np
import pytest
from driven_rooms import GEOMETRY, cast, odd_room
from hypothesis import given, settings
from hypothesis import strategies as st
from mapped_room import ORIGIN, SUBMAPS, odd_room_submap, points_of
from scipy.interpolate import BSpline

from lidarium.mapping.geometry.rigid import composed
from lidarium.mapping.localization.matching.branch_and_bound import place, pyramid
from lidarium.mapping.localization.matching.scan_matching import (
    _agreement,
    _extremes_around,
    _find_normals,
    _is_unseen,
    refine,
)
from lidarium.mapping.localization.matching.scan_search import search
from lidarium.mapping.localization.matching.submaps import FREE_LEVEL, FULL_LEVEL, UNSEEN, Submap

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
            cast(odd_room(), pose) + generator.normal(0.0, 0.03, GEOMETRY.beams).astype(np.float32) for _ in range(2)
        ]
        submap = Submap(SUBMAPS, 12.0)
        submap.insert(np.zeros(3), scans[0], GEOMETRY, 20.0)
        turns.append(
            refine(submap.grid, points_of(scans[1]), np.zeros(3), np.zeros(3), np.zeros((3, 3)), 500.0, 0.3).pose[2]
        )
    assert abs(np.mean(turns)) < 3.0 * np.std(turns) / math.sqrt(len(turns))


LEVELS = np.random.default_rng(2).integers(0, 256, (12, 15)).astype(np.uint8)


def plain(levels, x, y):
    """The tensor product of uniform cubic B-splines on the centres of cells."""
    bump = BSpline.basis_element(np.arange(-2.0, 3.0), extrapolate=False)
    heights = np.maximum(levels.astype(float) - FREE_LEVEL, 0.0) / (FULL_LEVEL - FREE_LEVEL)
    across, along = (
        np.nan_to_num(bump(place - 0.5 - np.arange(count)))
        for place, count in zip((x, y), levels.shape[::-1], strict=True)
    )
    return float(along @ heights @ across)


@pytest.mark.parametrize("place", [(5.0, 6.0), (4.27, 7.81), (8.5, 5.5), (9.99, 3.01)])
def test_the_value_is_that_of_a_plain_spline_and_slopes_are_its_differences(place):
    x, y = place
    value, slope_x, slope_y = _agreement(LEVELS, x, y)
    assert value == pytest.approx(plain(LEVELS, x, y), abs=1e-12)
    step = 1e-5
    assert slope_x == pytest.approx((plain(LEVELS, x + step, y) - plain(LEVELS, x - step, y)) / (2 * step), abs=1e-6)
    assert slope_y == pytest.approx((plain(LEVELS, x, y + step) - plain(LEVELS, x, y - step)) / (2 * step), abs=1e-6)


def test_full_agreement_is_one_and_flat_and_what_is_free_or_unseen_is_nothing():
    for level, expected in ((FULL_LEVEL, 1.0), (FREE_LEVEL, 0.0), (UNSEEN, 0.0)):
        found = _agreement(np.full((10, 10), level, np.uint8), 4.3, 5.8)
        assert found == pytest.approx((expected, 0.0, 0.0), abs=1e-12)


def test_agreement_ends_where_the_map_does():
    full = np.full((10, 14), FULL_LEVEL, np.uint8)
    for x, y in ((1.4, 5.0), (5.0, 1.4), (12.5, 5.0), (5.0, 8.5), (-3.0, 5.0)):
        assert _agreement(full, x, y) == (0.0, 0.0, 0.0)
    assert _agreement(full, 12.4, 8.4)[0] == pytest.approx(1.0)


def test_cells_outside_of_the_map_are_unseen():
    levels = np.full((4, 6), FREE_LEVEL, np.uint8)
    levels[2, 3] = UNSEEN
    assert _is_unseen(levels, 3.9, 2.0)
    assert not _is_unseen(levels, 4.0, 2.0)
    for x, y in ((-0.1, 1.0), (6.0, 1.0), (1.0, -0.1), (1.0, 4.0)):
        assert _is_unseen(levels, x, y)


def test_extremes_are_those_of_the_square_of_seven_cells():
    padded = np.pad(LEVELS, 3, constant_values=UNSEEN)
    for row, column in ((0, 0), (5, 7), (11, 14), (3, 3)):
        window = padded[row : row + 7, column : column + 7]
        assert _extremes_around(LEVELS, column, row) == (window.min(), window.max())


def normals_of(points, reach=0.3):
    normals = np.zeros((len(points), 2))
    _find_normals(np.ascontiguousarray(points, np.float64), reach, normals)
    return normals


def wall(begin, end, count):
    share = np.linspace(0.0, 1.0, count)[:, None]
    return np.asarray(begin) * (1.0 - share) + np.asarray(end) * share


@pytest.mark.parametrize("angle", [0.0, 0.4, 1.5, -2.2])
def test_points_of_a_wall_have_its_normal_though_noise_moves_them(angle):
    along = np.array([math.cos(angle), math.sin(angle)])
    across = np.array([-along[1], along[0]])
    points = 2.0 * across + np.linspace(-1.0, 1.0, 41)[:, None] * along
    noisy = points + 0.004 * np.random.default_rng(1).normal(size=points.shape)
    assert np.abs(normals_of(points) @ along).max() < 1e-9
    found = normals_of(noisy)
    np.testing.assert_allclose(np.hypot(*found.T), 1.0)
    wide, narrow = np.abs(found @ along), np.abs(normals_of(noisy, 0.06) @ along)
    assert wide.max() < 0.15
    assert np.sqrt((wide**2).mean()) < 0.5 * np.sqrt((narrow**2).mean())


def test_a_corner_is_not_smeared_over_its_walls():
    points = np.vstack([wall((2.0, -1.0), (2.0, 1.0), 41), wall((1.95, 1.0), (0.0, 1.0), 40)])
    found = np.abs(normals_of(points))
    np.testing.assert_allclose(found[:34], np.tile((1.0, 0.0), (34, 1)), atol=1e-6)
    np.testing.assert_allclose(found[-33:], np.tile((0.0, 1.0), (33, 1)), atol=1e-6)
    # At the corner itself the two neighbours give the diagonal.
    assert found[40] == pytest.approx((math.sqrt(0.5), math.sqrt(0.5)))


def test_surfaces_end_at_gaps():
    points = np.vstack([wall((1.0, -0.5), (1.0, 0.0), 6), wall((3.0, 0.1), (3.5, 0.1), 6)])
    found = np.abs(normals_of(points, 5.0))
    np.testing.assert_allclose(found[:6], np.tile((1.0, 0.0), (6, 1)), atol=1e-9)
    np.testing.assert_allclose(found[6:], np.tile((0.0, 1.0), (6, 1)), atol=1e-9)


def test_a_point_alone_has_no_normal_and_two_have_that_of_their_line():
    assert normals_of([(1.0, 2.0)]).tolist() == [[0.0, 0.0]]
    assert normals_of([(1.0, 0.0), (9.0, 0.0)]).tolist() == [[0.0, 0.0]] * 2
    assert np.abs(normals_of([(1.0, 0.0), (1.1, 0.0)])).tolist() == [[0.0, 1.0]] * 2
    assert normals_of(np.zeros((0, 2))).shape == (0, 2)
