"""Edges between neighbouring beams, listed at once or one by one."""

import math

import numpy as np
import pytest

from lidarium.mapping.grids.outlines.outline_edges import Outline, toggle_between, toggle_edges
from lidarium.mapping.grids.outlines.toggled_bits import row_of
from lidarium.mapping.grids.scan_geometry import ScanGeometry

ROWS, WIDTH, PLACE = 128, 128, 62.3
TURN = 0.01
"""Of the laser, so that no beam runs along an axis [rad]."""


def outline_of(lengths, steepness=1.0):
    """An outline of beams all around a laser in the middle of a window."""
    angles = ScanGeometry(beams=len(lengths), field_of_view=2.0 * math.pi).angles + TURN
    unit = np.stack([np.cos(angles), np.sin(angles)])
    directions = np.concatenate([unit, 1.0 / unit])
    lengths = np.asarray(lengths, np.float64)
    return Outline(lengths, directions, PLACE + lengths * unit, PLACE, PLACE, steepness)


def toggled(outline, at_once):
    words = np.zeros((ROWS, WIDTH // 64), np.uint64)
    if at_once:
        rows = np.array([row_of(y) for y in outline.ends[1].tolist()], np.int32)
        toggle_edges(words.ctypes.data, WIDTH, outline, rows)
    else:
        for k in range(len(outline.lengths) - 1):
            toggle_between(words.ctypes.data, WIDTH, outline, k, k + 1)
    return words


@pytest.mark.parametrize("seed", range(6))
def test_all_edges_at_once_toggle_what_they_do_one_by_one(seed):
    generator = np.random.default_rng(seed)
    count = int(generator.integers(20, 400))
    lengths = 20.0 + 15.0 * np.sin(np.arange(count) * 0.05) + generator.uniform(-2.0, 2.0, count)
    lengths[generator.random(count) < 0.1] = 50.0
    outline = outline_of(lengths, generator.choice([0.05, 1.0]))
    once = toggled(outline, True)
    assert once.any()
    np.testing.assert_array_equal(once, toggled(outline, False))


def test_between_a_near_and_a_far_end_the_outline_goes_along_the_far_beam():
    # Beams from -pi on; those ahead are far, with an edge to their right and left.
    lengths = np.full(64, 10.0)
    lengths[24:40] = 40.0
    outline = outline_of(lengths, 0.1)
    words = toggled(outline, True)
    last = np.zeros_like(words)
    toggle_between(last.ctypes.data, WIDTH, outline, 63, 0)
    inside = np.logical_xor.accumulate(
        np.unpackbits((words ^ last).view(np.uint8), bitorder="little").reshape(ROWS, WIDTH), axis=1
    )
    rows, columns = np.nonzero(inside)
    x, y = columns + 0.5 - PLACE, rows + 0.5 - PLACE
    beam = np.mod(np.arctan2(y, x) + math.pi - TURN, 2.0 * math.pi) / (2.0 * math.pi / 64)
    # Nothing is claimed behind the near ends, up to the far beams themselves.
    beyond = np.hypot(x, y) > 10.5
    assert ((beam[beyond] > 24.0 - 0.05) & (beam[beyond] < 39.0 + 0.05)).all()
    assert beyond.sum() > 500
