"""Pieces of a map, turned."""

import numpy as np
import pytest

from lidarium.mapping.planning.touring.map_crops import FREE, OCCUPIED, UNKNOWN, map_crops


def plain_crop(log_odds, resolution, cell, direction, side, step):
    """Return a piece of a map, written plainly."""
    samples = max(round(step / resolution), 1)
    crop = np.zeros((side, side), np.int8)
    ahead, left = (
        np.array([np.cos(direction), np.sin(direction)]),
        np.array([-np.sin(direction), np.cos(direction)]),
    )
    centre = (np.array([cell[1], cell[0]]) + 0.5) * resolution
    for i in range(side):
        for j in range(side):
            levels = []
            for a in range(samples):
                for b in range(samples):
                    x, y = (
                        centre
                        + (i - side // 4 + (a + 0.5) / samples) * step * ahead
                        + (j - side // 2 + (b + 0.5) / samples) * step * left
                    )
                    row, column = int(np.floor(y / resolution)), int(np.floor(x / resolution))
                    if 0 <= row < log_odds.shape[0] and 0 <= column < log_odds.shape[1]:
                        levels.append(int(np.sign(log_odds[row, column])))
            crop[i, j] = OCCUPIED if OCCUPIED in levels else FREE if FREE in levels else UNKNOWN
    return crop


@pytest.mark.parametrize("direction", [0.1, 1.3, -2.2, 3.0])
def test_crops_are_those_of_the_plain_definition(direction):
    generator = np.random.default_rng(1)
    log_odds = generator.choice([-20, 0, 0, 20], size=(40, 50)).astype(np.int8)
    cells = np.array([[5, 45], [20, 20]])
    found = map_crops(log_odds, 0.1, cells, np.full(2, direction), 8, 0.3)
    for cell, crop in zip(cells, found, strict=True):
        # A sample on the edge of a cell may fall to either side.
        assert (crop == plain_crop(log_odds, 0.1, cell, direction, 8, 0.3)).mean() > 0.95


def test_rows_go_ahead_and_columns_to_the_left():
    log_odds = np.full((60, 60), -20, np.int8)
    log_odds[30, 40:] = 20  # a wall in the direction of x
    log_odds[45:, :] = 0  # unknown to the left of it
    (crop,) = map_crops(log_odds, 0.1, np.array([[30, 30]]), np.zeros(1), 16, 0.2)
    assert (crop[10:, 7] == OCCUPIED).all()
    assert (crop[:8] != OCCUPIED).all()
    assert (crop[:, -1] == UNKNOWN).any()
    assert (crop[:, 0] == FREE).all()


def test_around_the_map_all_is_unknown():
    (crop,) = map_crops(np.full((4, 4), -20, np.int8), 0.1, np.array([[2, 2]]), np.zeros(1), 8, 1.0)
    assert (crop == UNKNOWN).sum() >= 60
    assert (crop == FREE).any()
