"""What can be shown of an episode at any time."""

import numpy as np
import pytest

from lidarium.evaluation.record.display import DisplayTrack, MapChanges


@pytest.fixture
def changes():
    """Two rows of two words; a cell is free, then a wall is found, then the cell is forgotten."""
    return MapChanges(
        rows=2,
        words=2,
        times=np.array([0.0, 2.0, 4.0]),
        counts=np.array([1, 2, 1]),
        places=np.array([1, 1, 2, 1]),
        known=np.array([0b1, 0b1000, 1 << 63, 0b1], np.uint64),
        occupied=np.array([0b0, 0b1000, 0, 0b0], np.uint64),
    )


def test_a_map_is_that_of_the_last_sample(changes):
    first = changes.levels_at(1.9)
    assert first.shape == (2, 128)
    assert np.argwhere(first != 127).tolist() == [[1, 0]]
    assert first[1, 0] == 255
    second = changes.levels_at(2.0)
    assert (second[1, 3], second[0, 127], second[1, 0]) == (0, 255, 255)
    assert np.argwhere(changes.levels_at(99.0) != 127).tolist() == [[0, 127], [1, 3]]


def test_before_the_first_sample_nothing_is_known(changes):
    assert (changes.levels_at(-1.0) == 127).all()


def test_poses_and_coverage_hold_until_the_next_ones(changes):
    poses = np.arange(6.0).reshape(2, 1, 3)
    track = DisplayTrack(
        np.array([0.0, 0.2]), poses, np.array([[1.0, 0.25], [3.0, 0.5]]), (0.0, 0.0), 0.1, changes, []
    )
    assert track.poses_at(-1.0).tolist() == track.poses_at(0.1).tolist() == [[0.0, 1.0, 2.0]]
    assert track.poses_at(0.2).tolist() == track.poses_at(9.0).tolist() == [[3.0, 4.0, 5.0]]
    assert [track.coverage_at(time) for time in (0.5, 1.0, 2.9, 3.0, 9.0)] == [0.0, 0.25, 0.25, 0.5, 0.5]
