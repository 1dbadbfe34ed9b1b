"""Edges at which two regions meet, by a look at each pair of neighbours."""

import numpy as np
import pytest

from lidarium.mapping.merging.regions.meetings import NONE, find_meetings


def by_pairs(labels, clearance):
    found = []
    rows, columns = labels.shape
    for row in range(rows):
        for column in range(columns):
            for down, right in ((0, 1), (1, 0)):
                beside = row + down, column + right
                if beside[0] >= rows or beside[1] >= columns:
                    continue
                pair = labels[row, column], labels[beside]
                if NONE in pair or pair[0] == pair[1]:
                    continue
                middle = (0.5 + column + 0.5 * right, 0.5 + row + 0.5 * down)
                found.append(
                    (
                        *pair,
                        min(clearance[row, column], clearance[beside]),
                        *middle,
                        float(right),
                        float(down),
                    )
                )
    return sorted(found)


@pytest.mark.parametrize("seed", range(8))
def test_edges_are_those_of_all_pairs_of_neighbours(seed):
    generator = np.random.default_rng(seed)
    labels = generator.integers(NONE, 3, (9, 13)).astype(np.int32)
    clearance = generator.random((9, 13)).astype(np.float32)
    met = find_meetings(labels, clearance)
    assert len(met.regions) > 20
    columns = (*met.regions.T, met.clearance, *met.places.T, *met.steps.T)
    assert sorted(zip(*(column.tolist() for column in columns), strict=True)) == by_pairs(labels, clearance)


def test_a_meeting_by_hand():
    labels = np.array([[0, 0, NONE], [1, 0, 2]], np.int32)
    clearance = np.array([[1.0, 2.0, 0.0], [3.0, 4.0, 5.0]], np.float32)
    met = find_meetings(labels, clearance)
    order = np.lexsort(met.places.T)
    assert met.regions[order].tolist() == [[0, 1], [1, 0], [0, 2]]
    assert met.places[order].tolist() == [[0.5, 1.0], [1.0, 1.5], [2.0, 1.5]]
    assert met.steps[order].tolist() == [[0.0, 1.0], [1.0, 0.0], [1.0, 0.0]]
    assert met.clearance[order].tolist() == [1.0, 3.0, 4.0]


@pytest.mark.parametrize("label", [0, NONE])
def test_one_region_meets_nothing(label):
    met = find_meetings(np.full((4, 5), label, np.int32), np.ones((4, 5), np.float32))
    assert met.regions.shape == met.places.shape == met.steps.shape == (0, 2)
    assert len(met.clearance) == 0
