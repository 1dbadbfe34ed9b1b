"""Codes of a map become fewer where their boxes add nothing to each other."""

import numpy as np
import pytest

from lidarium.mapping.sparse.mapper.code_merging import merged_codes
from lidarium.mapping.sparse.settings import MapperSettings
from lidarium.mapping.sparse.sparse_map import OccupiedCodes

SETTINGS = MapperSettings()
NOTHING_FREE = np.empty((0, 3))


def codes(boxes, weights, normals, frames):
    boxes = np.array(boxes, float)
    return OccupiedCodes(
        boxes=boxes,
        centres=boxes.mean(axis=1),
        weights=np.array(weights, float),
        normals=np.array(normals, float),
        frames=np.array(frames),
    )


# Two halves of one wall, and a box apart.
LEFT, RIGHT, APART = [[0, 0, 0], [1, 0.01, 1]], [[1, 0, 0], [2, 0.01, 1]], [[5, 5, 0], [5.5, 5.5, 1]]
ALONG_Y, NONE = (0.0, 1.0, 0.0), (0.0, 0.0, 0.0)


def test_halves_of_a_wall_become_one_code_of_the_heavier_frame():
    both = codes([LEFT, APART, RIGHT], [1.0, 2.0, 3.0], [ALONG_Y, NONE, (0.0, -1.0, 0.0)], [4, 5, 6])
    merged, origins = merged_codes(both, NOTHING_FREE, SETTINGS)
    assert len(merged) == 2
    wall = int(np.flatnonzero(origins == -1)[0])
    np.testing.assert_allclose(merged.boxes[wall], [[0, 0, 0], [2, 0.01, 1]])
    np.testing.assert_allclose(merged.centres[wall], (1.25, 0.005, 0.5))
    assert (merged.weights[wall], merged.frames[wall]) == (4.0, 6)
    np.testing.assert_allclose(merged.normals[wall], ALONG_Y)
    assert origins[1 - wall] == 1
    np.testing.assert_array_equal(merged.boxes[1 - wall], both.boxes[1])


@pytest.mark.parametrize("second", [(1.0, 0.0, 0.0), NONE])
def test_codes_that_share_no_plane_have_no_normal(second):
    both = codes([LEFT, RIGHT], [1.0, 1.0], [ALONG_Y, second], [0, 0])
    merged, _ = merged_codes(both, NOTHING_FREE, SETTINGS)
    assert merged.normals.tolist() == [[0.0, 0.0, 0.0]]


def test_boxes_do_not_grow_over_free_codes():
    gapped = codes([LEFT, [[1.02, 0, 0], [2, 0.01, 1]]], [1.0, 1.0], [ALONG_Y] * 2, [0, 1])
    free = np.array([[1.01, 0.005, 0.0]])
    assert len(merged_codes(gapped, NOTHING_FREE, MapperSettings(slack_m=0.05))[0]) == 1
    kept, origins = merged_codes(gapped, free, MapperSettings(slack_m=0.05))
    assert len(kept) == 2
    assert sorted(origins.tolist()) == [0, 1]


def test_codes_that_are_not_to_merge_stay_as_they_are():
    both = codes([LEFT, RIGHT], [1.0, 1.0], [ALONG_Y] * 2, [0, 1])
    same, origins = merged_codes(both, NOTHING_FREE, MapperSettings(merges=False))
    assert same is both
    assert origins.tolist() == [0, 1]
