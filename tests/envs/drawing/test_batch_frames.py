"""Pictures of episodes are of one size, and tiled."""

import numpy as np
import pytest

from lidarium.envs.drawing.batch_frames import _padded, tiled


def test_tiles_are_side_by_side():
    frames = [np.full((2, 4, 3), k, np.uint8) for k in range(3)]
    assert tiled(frames)[:, :, 0].tolist() == [[0] * 4 + [1] * 4] * 2 + [[2] * 4 + [255] * 4] * 2
    with pytest.raises(ValueError, match="frames are empty"):
        tiled([])


@pytest.mark.parametrize(("count", "shape"), [(1, (2, 4)), (2, (2, 8)), (4, (4, 8)), (5, (4, 12)), (10, (6, 16))])
def test_there_are_about_as_many_rows_as_columns(count, shape):
    assert tiled([np.zeros((2, 4, 3), np.uint8)] * count).shape == (*shape, 3)


def test_what_a_floor_leaves_of_its_picture_is_white():
    padded = _padded(np.zeros((2, 9, 3), np.uint8), (3, 5, 3))
    assert padded[:, :, 0].tolist() == [[0] * 5] * 2 + [[255] * 5]
