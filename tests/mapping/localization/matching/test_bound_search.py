"""The search by branch-and-bound finds what trying every placement finds."""

import math

import numpy as np
import pytest

from lidarium.mapping.localization.matching.bound_search import CoarseLevels, Window, find_placements
from lidarium.mapping.localization.matching.branch_and_bound import pyramid
from lidarium.mapping.localization.matching.submaps import AgreementGrid

HEADINGS = np.array([-0.2, 0.0, 0.3])


def case(seed, width=21):
    """A random map, points that partly fall outside of it, and a window."""
    generator = np.random.default_rng(seed)
    levels = (generator.random((37, 45)) ** 4 * 255).astype(np.uint8)
    points = generator.uniform(-14.0, 14.0, (40, 2))
    corner = generator.uniform(5.0, 15.0, 2)
    return levels, points, Window(HEADINGS, corner, width)


def searched(levels, points, window, least=0.0, evaluations=10**6, avoided=(0.0, 0.0, 0.0, 0.0, 0.0)):
    coarse, found = pyramid(AgreementGrid(levels, 0, 0, 0.05)), np.full(4, -1.0)
    is_over = find_placements(
        CoarseLevels(coarse.maxima, coarse.shapes),
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
