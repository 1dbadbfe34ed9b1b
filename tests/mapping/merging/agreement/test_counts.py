"""Counts of how two maps agree."""

import numpy as np
import pytest
from drawn_maps import RESOLUTION, apartment, blank, kept, room

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.grids.occupancy import UNKNOWN
from lidarium.mapping.merging.agreement.counts import (
    STRIDE,
    WallField,
    count_overlap,
    count_walls,
    disc_agreement,
)
from lidarium.mapping.merging.description.described_map import describe_map


def test_discs_count_cells_once_and_unknown_ones_too():
    a = describe_map(apartment(), RESOLUTION)
    points = a.corners.points
    assert disc_agreement(a, a, Transform(), points, 25) == 1.0
    assert disc_agreement(a, a, Transform(), np.concatenate([points, points]), 25) == 1.0
    assert disc_agreement(a, a, Transform(0.5, 0.0, 0.0), points, 25) < 0.9
    other = describe_map(kept(apartment(), slice(0, 60), slice(0, 80)), RESOLUTION)
    assert disc_agreement(other, a, Transform(), points, 25) < 0.9


def field_of(described):
    return WallField(described.levels, described.distance, described.is_open, 1.0 / RESOLUTION, 0.075, 0.175)


def test_walls_that_agree_miss_and_contradict_are_counted_apart():
    described = describe_map(room(blank(80, 100), 20, 20, 40, 60), RESOLUTION)
    walls = np.array([[2.0, 0.975], [2.0, 1.1], [2.0, 2.0], [2.0, 0.5], [-1.0, 2.0]])
    counts, facing = np.zeros(3, np.int64), np.zeros(3)
    count_walls(field_of(described), walls, np.tile((0.0, 1.0), (5, 1)), (0.0, 0.0, 0.0), counts, facing)
    # The fourth stands where nothing is known, the fifth outside of the map: neither is counted.
    assert counts.tolist() == [1, 1, 1]
    assert facing.tolist() == [0.0, 0.0, 1.0]


def test_the_other_side_of_a_thin_wall_does_not_agree():
    levels = room(blank(80, 100), 20, 20, 40, 60)
    counts, facing = np.zeros(3, np.int64), np.zeros(3)
    wall = np.array([[2.0, 0.975]])
    away = np.array([[0.0, -1.0]])
    count_walls(field_of(describe_map(levels, RESOLUTION)), wall, away, (0.0, 0.0, 0.0), counts, facing)
    assert counts.tolist() == [0, 1, 0]


@pytest.mark.parametrize("pose", [(0.0, 0.0, 0.0), (0.4, -0.3, 0.0), (1.0, 0.2, 0.7)])
def test_the_overlap_is_that_of_a_plain_count_of_every_third_cell(pose):
    generator = np.random.default_rng(4)
    a, b = (generator.choice(np.array([0, 127, 255], np.uint8), (30, 40)) for _ in range(2))
    found = np.zeros(3)
    count_overlap(a, b, 0.1, pose, found)
    both = []
    for row in range(1, 30, STRIDE):
        for column in range(1, 40, STRIDE):
            centre = np.array([column + 0.5, row + 0.5]) * 0.1
            x, y = np.floor(Transform(*pose).apply(centre) / 0.1 + 1e-9).astype(int)
            if b[row, column] != UNKNOWN and 0 <= x < 40 and 0 <= y < 30 and a[y, x] != UNKNOWN:
                both.append(centre)
    assert found[0] == len(both) * STRIDE**2
    np.testing.assert_allclose(found[1:] / found[0], np.mean(both, axis=0))
