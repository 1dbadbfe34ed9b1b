"""Seen cells are lowered, and cells in which beams ended raised, each once."""

import numpy as np
import pytest

from lidarium.mapping.grids.pooled_maps import untouched
from lidarium.mapping.grids.scan_integration import SeenScan, integrate_scan

INCREMENTS = np.array([9, 4, -20, 30], np.int64)


def scan_of(seen, cells, is_hit, offset):
    """A scan that has seen cells (rows, columns) of a window, with ends of beams in cells (x, y)."""
    rows, columns = seen.shape
    bits = np.packbits(seen, axis=1, bitorder="little").view(np.uint64)
    ends = np.array(cells, np.float64).T + 0.4
    box = (0, rows, 0, columns // 64)
    return SeenScan(bits, np.zeros_like(bits), box, ends, np.array(is_hit), *offset)


@pytest.mark.parametrize("offset", [(0, 0), (5, 64), (-7, -64), (38, 128)])
def test_a_map_is_updated_cell_by_cell_as_is_defined(offset):
    generator = np.random.default_rng(3)
    log_odds = generator.integers(-20, 31, (48, 192)).astype(np.int8)
    seen = generator.random((16, 128)) < 0.4
    cells = generator.integers(0, (128, 16), (60, 2))
    is_hit = generator.random(60) < 0.7
    hits = np.zeros_like(seen)
    hits[cells[is_hit, 1], cells[is_hit, 0]] = True
    expected, touched = log_odds.copy().astype(int), untouched(48, 192)
    for row in range(16):
        for column in range(128):
            i, j = row + offset[0], column + offset[1]
            if 0 <= i < 48 and 0 <= j < 192:
                if hits[row, column]:
                    expected[i, j] = min(expected[i, j] + 9, 30)
                elif seen[row, column]:
                    expected[i, j] = max(expected[i, j] - 4, -20)
    before = log_odds.copy()
    integrate_scan(log_odds, scan_of(seen, cells, is_hit, offset), INCREMENTS, touched)
    np.testing.assert_array_equal(log_odds, expected)
    # Words in which one of the three levels has changed are noted, with their rows, and no others.
    changed = (np.sign(log_odds) != np.sign(before)).reshape(48, 3, 64).any(axis=2)
    marked = (touched[:48, :1] >> np.arange(3, dtype=np.uint64)) & np.uint64(1)
    np.testing.assert_array_equal(marked.astype(bool), changed)
    rows = [bool(int(touched[48, 0]) >> row & 1) for row in range(48)]
    assert rows == changed.any(axis=1).tolist()


def test_nothing_is_noted_where_no_notes_are_taken():
    log_odds = np.zeros((8, 64), np.int8)
    seen = np.ones((8, 64), np.bool_)
    integrate_scan(log_odds, scan_of(seen, [(3, 2)], [True], (0, 0)), INCREMENTS, np.zeros((0, 1), np.uint64))
    assert log_odds[2, 3] == 9
    assert (np.delete(log_odds.ravel(), 2 * 64 + 3) == -4).all()
