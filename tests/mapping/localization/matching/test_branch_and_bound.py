"""The best placement within a wide window is found without looking everywhere."""

import math

import numpy as np
import pytest
from driven_rooms import cast, odd_room
from hypothesis import given, settings
from hypothesis import strategies as st
from mapped_room import ORIGIN, odd_room_submap, points_of

from lidarium.mapping.geometry.rigid import composed
from lidarium.mapping.localization.matching.branch_and_bound import (
    _CoarseLevels,
    _find_placements,
    _Window,
    place,
    pyramid,
)
from lidarium.mapping.localization.matching.submaps import AgreementGrid


@pytest.fixture(scope="module")
def submap():
    """The odd room as seen from places around its middle."""
    return odd_room_submap()


offsets = st.tuples(st.floats(-0.4, 0.4), st.floats(-0.4, 0.4), st.floats(-0.25, 0.25))


@settings(max_examples=10)
@given(offset=offsets, error=st.tuples(st.floats(-1.5, 1.5), st.floats(-1.0, 1.0), st.floats(-0.5, 0.5)))
def test_branch_and_bound_finds_it_within_a_wide_window(submap, offset, error):
    true = np.array(offset)
    points = points_of(cast(odd_room(), composed(ORIGIN, true)))
    found, is_over = place(pyramid(submap.finished()), points, true + np.array(error), (1.6, 0.6), 0.3, 200_000)
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
                cells = np.floor(corner / 0.05 + 1e-9) + np.array([round((x + 0.4) / 0.05), round((y + 0.4) / 0.05)])
                columns, rows = (cells - np.array([grid.column, grid.row])).astype(int).T
                is_in = (rows >= 0) & (columns >= 0) & (rows < grid.levels.shape[0]) & (columns < grid.levels.shape[1])
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


def test_coarse_maps_hold_the_most_of_every_block_that_a_placement_can_reach():
    generator = np.random.default_rng(3)
    levels = generator.integers(0, 256, (37, 70)).astype(np.uint8)
    coarse = pyramid(AgreementGrid(levels, 0, 0, 0.05))
    for level, (begin, rows, columns) in enumerate(coarse.shapes.tolist()):
        maxima = coarse.maxima[begin : begin + rows * columns].reshape(rows, columns)
        if level == 0:
            np.testing.assert_array_equal(maxima, levels)
            continue
        side = 1 << level
        for i in range(rows):
            for j in range(columns):
                # The first row and column begin a block before the map.
                block = levels[max(i - 1, 0) * side : (i + 1) * side, max(j - 1, 0) * side : (j + 1) * side]
                assert maxima[i, j] == block.max(initial=0)
    assert len(coarse.maxima) == sum(rows * columns for _, rows, columns in coarse.shapes.tolist())


HEADINGS = np.array([-0.2, 0.0, 0.3])


def case(seed, width=21):
    """A random map, points that partly fall outside of it, and a window."""
    generator = np.random.default_rng(seed)
    levels = (generator.random((37, 45)) ** 4 * 255).astype(np.uint8)
    points = generator.uniform(-14.0, 14.0, (40, 2))
    corner = generator.uniform(5.0, 15.0, 2)
    return levels, points, _Window(HEADINGS, corner, width)


def searched(levels, points, window, least=0.0, evaluations=10**6, avoided=(0.0, 0.0, 0.0, 0.0, 0.0)):
    coarse, found = pyramid(AgreementGrid(levels, 0, 0, 0.05)), np.full(4, -1.0)
    is_over = _find_placements(
        _CoarseLevels(coarse.maxima, coarse.shapes),
        points,
        window,
        float(least),
        evaluations,
        np.array(avoided),
        found,
    )
    return found.tolist(), is_over


def sums_of(levels, points, window):
    """The sum of the levels at the points for every placement, (headings, rows, columns)."""
    sums = np.zeros((len(HEADINGS), window.width, window.width), int)
    for turn, heading in enumerate(window.headings.tolist()):
        cosine, sine = math.cos(heading), math.sin(heading)
        for x, y in points.tolist():
            column = math.floor(cosine * x - sine * y + window.corner[0])
            row = math.floor(sine * x + cosine * y + window.corner[1])
            for i in range(window.width):
                for j in range(window.width):
                    if 0 <= row + i < levels.shape[0] and 0 <= column + j < levels.shape[1]:
                        sums[turn, i, j] += levels[row + i, column + j]
    return sums


@pytest.mark.parametrize(("seed", "width"), [(0, 21), (1, 21), (2, 1), (3, 33)])
def test_the_best_placement_is_that_of_a_search_everywhere(seed, width):
    levels, points, window = case(seed, width)
    sums = sums_of(levels, points, window)
    (column, row, turn, most), is_over = searched(levels, points, window)
    assert is_over
    assert most == sums.max()
    assert sums[int(turn), int(row), int(column)] == most


def test_nothing_is_found_that_does_not_exceed_the_least():
    levels, points, window = case(4)
    most = sums_of(levels, points, window).max()
    assert searched(levels, points, window, most) == ([-1.0] * 4, True)
    assert searched(levels, points, window, most - 1)[0][3] == most


def test_placements_that_are_avoided_are_left_out_and_their_neighbours_are_not():
    levels, points, window = case(5)
    sums = sums_of(levels, points, window).astype(float)
    (column, row, turn, _), _ = searched(levels, points, window)
    # A full turn away is the same heading.
    avoided = (column, row, HEADINGS[int(turn)] + math.tau, 3.0, 0.1)
    i, j = np.indices(sums.shape[1:])
    sums[int(turn), (j - column) ** 2 + (i - row) ** 2 < 9.0] = -1.0
    found, is_over = searched(levels, points, window, avoided=avoided)
    assert is_over
    assert found[3] == sums.max()


def test_a_search_ends_undecided_after_its_evaluations():
    levels, points, window = case(6, 33)
    assert not searched(levels, points, window, evaluations=1)[1]
