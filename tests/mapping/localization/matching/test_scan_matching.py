"""Scans are placed in submaps: within a window, everywhere, and by odometry where walls hold nothing."""

import math

import numpy as np
import pytest
from driven_rooms import GEOMETRY, cast, odd_room
from hypothesis import given, settings
from hypothesis import strategies as st

from lidarium.mapping.geometry.rigid import composed
from lidarium.mapping.localization.matching.branch_and_bound import place, pyramid
from lidarium.mapping.localization.matching.scan_matching import refine
from lidarium.mapping.localization.matching.scan_points import scan_points
from lidarium.mapping.localization.matching.scan_search import search
from lidarium.mapping.localization.matching.settings.matching import MatchingSettings, SubmapSettings
from lidarium.mapping.localization.matching.submaps import FREE_LEVEL, UNSEEN, Submap

ORIGIN = np.array([2.5, 1.5, 0.3])
NOTHING_KNOWN = np.zeros((3, 3))


SUBMAPS = SubmapSettings(resolution=0.05)


def points_of(ranges):
    return scan_points(ranges, GEOMETRY.unit_vectors, GEOMETRY.angle_increment, 5.6, 0.08, 250)


@pytest.fixture(scope="module")
def submap():
    """The odd room as seen from places around its middle."""
    submap = Submap(SUBMAPS, 12.0)
    generator = np.random.default_rng(0)
    for offset in generator.uniform(-0.5, 0.5, (8, 3)):
        pose = composed(ORIGIN, offset)
        assert submap.insert(offset, cast(odd_room(), pose), GEOMETRY, 20.0)
    return submap


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


@settings(max_examples=10)
@given(offset=offsets, error=st.tuples(st.floats(-1.5, 1.5), st.floats(-1.0, 1.0), st.floats(-0.5, 0.5)))
def test_branch_and_bound_finds_it_within_a_wide_window(submap, offset, error):
    true = np.array(offset)
    points = points_of(cast(odd_room(), composed(ORIGIN, true)))
    found, is_over = place(
        pyramid(submap.finished()), points, true + np.array(error), (1.6, 0.6), 0.3, 200_000
    )
    assert is_over
    assert found is not None
    assert np.hypot(*(found.pose - true)[:2]) < 0.1
    assert abs(found.pose[2] - true[2]) < math.radians(2.5)


def test_branch_and_bound_finds_what_looking_everywhere_finds(submap):
    points = points_of(cast(odd_room(), composed(ORIGIN, np.array([0.1, -0.2, 0.05]))))
    grid = submap.finished()
    found, _ = place(pyramid(grid), points, np.zeros(3), (0.4, 0.08), 0.0, 10**7)
    assert found is not None
    best = 0.0
    steps = np.arange(-8, 9) * 0.05
    for heading in {round(float(found.pose[2]), 9)}:
        for x in steps:
            for y in steps:
                cosine, sine = math.cos(heading), math.sin(heading)
                # As the search does, cells are those of the window's corner and whole cells are added.
                corner = points @ np.array([[cosine, sine], [-sine, cosine]]) - 0.4
                cells = np.floor(corner / 0.05 + 1e-9) + np.array(
                    [round((x + 0.4) / 0.05), round((y + 0.4) / 0.05)]
                )
                columns, rows = (cells - np.array([grid.column, grid.row])).astype(int).T
                is_in = (
                    (rows >= 0)
                    & (columns >= 0)
                    & (rows < grid.levels.shape[0])
                    & (columns < grid.levels.shape[1])
                )
                best = max(best, grid.levels[rows[is_in], columns[is_in]].sum() / (255.0 * len(points)))
    assert found.score == pytest.approx(best, abs=0.01)


def test_a_search_that_is_not_over_says_so(submap):
    points = points_of(cast(odd_room(), ORIGIN))
    _, is_over = place(pyramid(submap.finished()), points, np.zeros(3), (1.5, 0.5), 0.0, 10)
    assert not is_over


def test_placements_keep_away_from_a_pose(submap):
    points = points_of(cast(odd_room(), ORIGIN))
    apart = (np.zeros(3), 0.5, math.radians(15.0))
    second, _ = place(pyramid(submap.finished()), points, np.zeros(3), (1.0, 0.2), 0.0, 10**7, apart)
    assert second is not None
    assert np.hypot(*second.pose[:2]) >= 0.45
    third, is_over = place(pyramid(submap.finished()), points, np.zeros(3), (1.0, 0.2), 0.7, 10**7, apart)
    assert third is None
    assert is_over


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


def test_of_poses_that_fit_alike_the_search_takes_the_one_that_odometry_expects(submap):
    points = points_of(cast(odd_room(), ORIGIN))
    expected = np.array([0.1, -0.05, 0.0])
    sure, unsure = np.diag([1e6, 1e6, 1e6]), NOTHING_KNOWN
    assert search(submap.grid, points, expected, 0.2, 0.05, sure, 500.0, 0.3) == pytest.approx(expected)
    found = search(submap.grid, points, expected, 0.2, 0.05, unsure, 500.0, 0.3)
    assert np.hypot(*found[:2]) < 0.06


def test_what_moved_fades_and_what_stays_stays():
    submap = Submap(SUBMAPS, 8.0)
    far, near = np.full(GEOMETRY.beams, 3.0, np.float32), np.full(GEOMETRY.beams, 1.0, np.float32)
    submap.insert(np.zeros(3), near, GEOMETRY, 20.0)
    for _ in range(9):
        submap.insert(np.zeros(3), far, GEOMETRY, 20.0)
    grid = submap.finished()

    def highest(distance):
        cells = np.round(np.array([distance, 0.0]) / 0.05).astype(int) - np.array([grid.column, grid.row])
        return int(grid.levels[cells[1] - 2 : cells[1] + 3, cells[0] - 2 : cells[0] + 3].max())

    assert highest(1.0) < 40
    assert highest(3.0) > 100


def test_what_a_submap_has_not_seen_is_unseen_and_what_it_saw_through_free():
    submap = Submap(SUBMAPS, 8.0)
    submap.insert(np.zeros(3), np.full(GEOMETRY.beams, 2.0, np.float32), GEOMETRY, 20.0)
    grid = submap.grid
    assert grid.levels[-grid.row, -grid.column + 20] == FREE_LEVEL
    assert grid.levels[-grid.row, -grid.column + 60] == UNSEEN


def test_a_scan_that_does_not_fit_in_changes_nothing():
    submap = Submap(SUBMAPS, 6.0)
    assert not submap.insert(
        np.array([40.0, 0.0, 0.0]), np.full(GEOMETRY.beams, 2.0, np.float32), GEOMETRY, 20.0
    )
    assert submap.scans == 0
    assert not submap.grid.levels.any()
    assert submap.finished().levels.shape == (1, 1)


def test_few_returns_count_less_than_many_but_not_more_than_all():
    matching = MatchingSettings()
    weights = [matching.weight(points) for points in (20, 40, 200, 10_000, 20_000)]
    assert weights[1] == pytest.approx(2 * weights[0])
    assert (
        weights[1]
        < weights[2]
        < weights[3]
        == weights[4]
        == pytest.approx(matching.independent_points / matching.deviation**2)
    )


def test_a_wall_that_is_seen_through_noise_lies_where_it_is():
    walls = np.array([(2.0, -20.0, 2.0, 20.0)], float)
    places = {}
    for behind_share in (0.0, 0.025):
        generator = np.random.default_rng(0)
        submap = Submap(SubmapSettings(resolution=0.035, behind_share=behind_share, behind_m=0.1), 12.0)
        for y in np.linspace(-0.5, 0.5, 30):
            pose = np.array([0.0, y, 0.0])
            submap.insert(
                pose,
                cast(walls, pose) + generator.normal(0.0, 0.04, GEOMETRY.beams).astype(np.float32),
                GEOMETRY,
                20.0,
            )
        grid = submap.finished()
        agreement = np.maximum(
            grid.levels[-grid.row - 20 : -grid.row + 20].astype(float) - FREE_LEVEL, 0.0
        ).sum(axis=0)
        centres = (np.arange(len(agreement)) + grid.column + 0.5) * grid.resolution
        places[behind_share] = np.average(centres, weights=agreement)
    assert places[0.0] > 2.015
    assert places[0.025] == pytest.approx(2.0, abs=0.005)


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
