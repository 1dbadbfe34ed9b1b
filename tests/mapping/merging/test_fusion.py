import numpy as np
import pytest
from drawn_maps import RESOLUTION, apartment, blank, kept, room
from hypothesis import given, settings
from hypothesis import strategies as st

from lidarium.mapping.files.map_files import FREE, OCCUPIED, UNKNOWN
from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.merging.fusion import fuse


def test_maps_that_agree_fuse_to_the_same_map_and_tell_who_saw_what():
    left, right = (
        kept(apartment(), slice(0, 180), slice(0, 130)),
        kept(apartment(), slice(0, 180), slice(90, 220)),
    )
    fused = fuse([left, right], [Transform(), Transform()], RESOLUTION)
    row, column = (round(value / RESOLUTION) for value in fused.origin[::-1])
    inside = apartment()[row : row + fused.levels.shape[0], column : column + fused.levels.shape[1]]
    np.testing.assert_array_equal(fused.levels, inside)
    seen = ((left != UNKNOWN).astype(int) + 2 * (right != UNKNOWN))[
        row : row + inside.shape[0], column : column + inside.shape[1]
    ]
    np.testing.assert_array_equal(fused.sources, seen)


@pytest.mark.parametrize(
    ("votes", "level"),
    [((0, 255), OCCUPIED), ((0, 255, 255), FREE), ((127, 255), FREE), ((127, 127, 0), OCCUPIED)],
)
def test_free_needs_a_majority_over_occupied(votes, level):
    fused = fuse([np.full((2, 2), vote, np.uint8) for vote in votes], [Transform()] * len(votes), 0.1)
    assert (fused.levels == level).all()


@settings(max_examples=15)
@given(st.floats(-3, 3), st.floats(-5, 5), st.floats(-5, 5))
def test_a_fused_map_lies_where_the_transform_puts_it(theta, x, y):
    pose = Transform(x, y, theta)
    fused = fuse([room(blank(40, 50), 10, 10, 20, 30)], [pose], 0.1)
    rows, columns = np.nonzero(fused.levels == FREE)
    middle = np.array([columns.mean() + 0.5, rows.mean() + 0.5]) * 0.1 + fused.origin
    np.testing.assert_allclose(middle, pose.apply((2.5, 2.0)), atol=0.05)


def test_nothing_known_cannot_be_fused():
    with pytest.raises(ValueError, match="knows anything"):
        fuse([blank()], [Transform()], 0.1)
    with pytest.raises(ValueError, match="0 maps"):
        fuse([], [], 0.1)
