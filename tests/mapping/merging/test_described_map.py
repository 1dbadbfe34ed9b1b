"""Features of a map that are computed before comparisons."""

import math

import numpy as np
import pytest
from drawn_maps import blank, room

from lidarium.mapping.files.map_files import FREE, OCCUPIED, UNKNOWN
from lidarium.mapping.merging.described_map import describe_map, resampled


@pytest.mark.parametrize(
    ("levels", "resolution", "message"),
    [
        (np.zeros((0, 5), np.uint8), 0.1, "shape"),
        (np.zeros((5, 5, 3), np.uint8), 0.1, "shape"),
        (np.zeros((5, 5)), 0.1, "type"),
        (np.zeros((5, 5), np.uint8), 0.0, "resolution"),
        (np.zeros((5, 5), np.uint8), math.nan, "resolution"),
    ],
)
def test_what_is_no_map_is_refused(levels, resolution, message):
    with pytest.raises(ValueError, match=message):
        describe_map(levels, resolution)


def test_walls_are_occupied_cells_beside_free_ones_and_face_them():
    described = describe_map(room(blank(60, 80), 10, 20, 30, 40, wall=3), 0.1)
    inside = {(column, row) for column in range(20, 60) for row in (9, 40)}
    inside |= {(column, row) for row in range(10, 40) for column in (19, 60)}
    assert {(int(x / 0.1), int(y / 0.1)) for x, y in described.walls.tolist()} == inside
    np.testing.assert_allclose(np.hypot(*described.normals.T), 1.0)
    middle = np.array([4.0, 2.5])
    assert (np.sum((middle - described.walls) * described.normals, axis=1) > 0.0).all()
    lower = np.flatnonzero((described.walls[:, 1] < 1.0) & (np.abs(described.walls[:, 0] - 4.0) < 1.0))
    np.testing.assert_allclose(described.normals[lower], np.tile((0.0, 1.0), (len(lower), 1)), atol=1e-12)


def test_a_wall_that_is_free_on_both_sides_has_no_normal():
    levels = np.full((21, 21), FREE, np.uint8)
    levels[10] = OCCUPIED
    described = describe_map(levels, 0.1)
    middle = np.abs(described.walls[:, 0] - 1.05) < 0.5
    assert (described.normals[middle] == 0.0).all()


def test_distances_are_to_the_faces_of_walls_in_metres():
    described = describe_map(room(blank(60, 80), 10, 20, 30, 40, wall=3), 0.1)
    assert described.distance[9, 30] == 0.0
    assert described.distance[15, 40] == pytest.approx(0.6, abs=1e-6)
    # Behind the face, within the thick wall, the distance grows again.
    assert described.distance[7, 40] == pytest.approx(0.2, abs=1e-6)
    assert (describe_map(blank(), 0.1).distance > 1e5).all()


@pytest.mark.parametrize(("resolution", "reach"), [(0.05, 2), (0.1, 1), (0.5, 1)])
def test_the_open_is_a_decimetre_and_at_least_a_cell_from_all_that_is_not_free(resolution, reach):
    levels = np.full((12, 15), FREE, np.uint8)
    levels[5, 6], levels[0, 14] = UNKNOWN, OCCUPIED
    expected = np.zeros(levels.shape, np.uint8)
    for row in range(12):
        for column in range(15):
            window = np.pad(levels, reach, constant_values=UNKNOWN)[
                row : row + 2 * reach + 1, column : column + 2 * reach + 1
            ]
            expected[row, column] = (window == FREE).all()
    np.testing.assert_array_equal(describe_map(levels, resolution).is_open, expected)


def test_coarser_cells_are_free_where_most_known_ones_are():
    levels = np.full((4, 6), UNKNOWN, np.uint8)
    levels[:2, :2] = FREE
    levels[:2, 2:4], levels[0, 2] = FREE, UNKNOWN
    levels[2, 0], levels[:2, 4] = FREE, FREE
    coarse = resampled(levels, 0.05, 0.1)
    assert coarse.tolist() == [[FREE, FREE, UNKNOWN], [UNKNOWN, UNKNOWN, UNKNOWN]]
    assert resampled(levels, 0.05, 0.2).shape == (1, 2)


def test_coarser_cells_keep_thin_walls():
    levels = np.full((40, 40), FREE, np.uint8)
    levels[:, 17] = OCCUPIED
    coarse = resampled(levels, 0.025, 0.1)
    assert coarse.shape == (10, 10)
    assert (coarse[:, 4] == OCCUPIED).all()
    assert (np.delete(coarse, 4, axis=1) == FREE).all()
    assert resampled(levels, 0.1, 0.1) is levels
