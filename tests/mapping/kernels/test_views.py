"""Arrays are viewed where they lie, inside kernels."""

import numpy as np

from lidarium.mapping.kernels.compilation import kernel
from lidarium.mapping.kernels.views import grid_at, scratch_grid, scratch_vector, vector_at


@kernel
def read_all(address, rows, columns):
    as_bytes = vector_at(address, rows * columns, np.uint8)
    return (
        as_bytes.sum(),
        grid_at(address, rows, columns, np.int8).sum(),
        grid_at(address, rows, columns, np.uint8)[rows - 1, columns - 1],
    )


@kernel
def write_words(address, rows, columns):
    grid = grid_at(address, rows, columns, np.uint64)
    for row in range(rows):
        grid[row, row % columns] = np.uint64(2**63)


@kernel
def sum_table(address, rows):
    return grid_at(address, rows, 3, np.int32).sum()


@kernel
def sum_grid(address, rows, columns):
    return grid_at(address, rows, columns, np.uint16).sum()


@kernel(nrt=False)
def sum_by_scratch(values):
    twice, rows = scratch_vector(values.shape[0], np.float64), scratch_grid(3, values.shape[0], np.int32)
    for k in range(values.shape[0]):
        twice[k], rows[1, k], rows[2, k] = 2.0 * values[k], 3, k
    total = 0.0
    for k in range(values.shape[0]):
        total += twice[k] * rows[1, k] + rows[2, k]
    return total


@kernel
def sum_often(values, times):
    total = 0.0
    for k in range(times):
        total += sum_by_scratch(values[k % 2 :])
    return total


def test_grids_are_viewed_where_they_lie():
    grid = np.arange(-6, 6, dtype=np.int8).reshape(3, 4)
    total, signed, last = read_all(grid.ctypes.data, 3, 4)
    assert total == grid.view(np.uint8).sum()
    assert signed == grid.sum()
    assert last == 5
    words = np.zeros((3, 2), np.uint64)
    write_words(words.ctypes.data, 3, 2)
    assert np.flatnonzero(words).tolist() == [0, 3, 4]
    table = np.arange(12, dtype=np.int32).reshape(4, 3)
    assert sum_table(table.ctypes.data, 4) == 66
    grid = np.arange(65_530, 65_536, dtype=np.uint16).reshape(2, 3)
    assert sum_grid(grid.ctypes.data, 2, 3) == int(grid.sum())


def test_scratch_is_there_while_a_kernel_runs_and_gone_when_it_returns():
    values = np.arange(1000.0)
    whole, rest = 6.0 * values.sum() + 499500.0, 6.0 * values.sum() + 498501.0
    assert sum_by_scratch(values) == whole
    # All together are larger than any stack.
    assert sum_often(values, 10_000) == 5_000 * (whole + rest)
