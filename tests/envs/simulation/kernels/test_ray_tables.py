"""What the ray casters look up for a floor."""

import numpy as np
import pytest

from lidarium.envs.simulation.kernels.ray_tables import MAX_SQUARE, TILE, RayTables


@pytest.mark.parametrize(
    ("solid", "words"),
    [(np.ones((2, 5), np.uint8), "at least 3 rows"), (np.zeros((5, 5), np.uint8), "outermost ring")],
)
def test_a_raster_that_rays_could_leave_is_refused(solid, words):
    with pytest.raises(ValueError, match=words):
        RayTables(solid)


def walled(rows, columns, generator=None):
    solid = np.ones((rows, columns), np.uint8)
    solid[1:-1, 1:-1] = 0 if generator is None else generator.random((rows - 2, columns - 2)) < 0.15
    return solid


def largest_square(solid, row, column, quadrant):
    """Return the side of the largest free square from a cell into a quadrant, by trying all."""
    step_column, step_row = (1 if quadrant & 1 == 0 else -1), (1 if quadrant & 2 == 0 else -1)
    side = 0
    while True:
        rows, columns = row + step_row * np.arange(side + 1), column + step_column * np.arange(side + 1)
        is_on = min(rows.min(), columns.min()) >= 0 and rows.max() < solid.shape[0] and columns.max() < solid.shape[1]
        if not is_on or solid[np.ix_(rows, columns)].any():
            return side
        side += 1


@pytest.mark.parametrize("seed", range(3))
def test_squares_are_the_largest_that_are_free(seed):
    solid = walled(14, 17, np.random.default_rng(seed))
    tables = RayTables(solid)
    for quadrant in range(4):
        for row, column in np.ndindex(solid.shape):
            assert tables.squares[quadrant, row, column] == largest_square(solid, row, column, quadrant)


def test_sides_of_squares_fit_a_byte():
    assert RayTables(walled(400, 400)).squares.max() == MAX_SQUARE


@pytest.mark.parametrize("shape", [(20, 30), (TILE + 20, 2 * TILE + 5)])
def test_faces_stand_between_free_and_solid_cells_each_once(shape):
    solid = walled(*shape, np.random.default_rng(4))
    tables = RayTables(solid)
    found = {0: set(), 1: set(), 2: set(), 3: set()}
    for group, (first, last) in enumerate(zip(tables.face_starts[:-1], tables.face_starts[1:], strict=True)):
        for line, low, high in tables.faces[first:last]:
            pieces = {(int(line), place) for place in range(low, high)}
            assert not pieces & found[group % 4]
            found[group % 4] |= pieces
    rows, columns = np.nonzero(solid == 0)
    for direction, (ahead_row, ahead_column) in enumerate(((0, 1), (0, -1), (1, 0), (-1, 0))):
        meets = solid[rows + ahead_row, columns + ahead_column] != 0
        lines, places = (columns, rows) if direction < 2 else (rows, columns)
        wanted = {
            (int(line) + (direction % 2 == 0), int(place))
            for line, place in zip(lines[meets], places[meets], strict=True)
        }
        assert found[direction] == wanted
