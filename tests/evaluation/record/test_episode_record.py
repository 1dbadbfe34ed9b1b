"""A recorded episode, and what of it is drawn."""

import numpy as np
import pytest

from lidarium.evaluation.record.episode_record import (
    FORMAT,
    MOST_MAP_WORDS,
    DisplayTrack,
    MapChanges,
    NewerFormatError,
    check_header,
)

HEADER = {
    "format": FORMAT,
    "version": "1.0.0",
    "policy": "nearest_frontier",
    "seed": None,
    "floor": "apartment",
    "floor_source": None,
    "floor_sha256": "a" * 64,
    "image_resolution": None,
    "robots": 2,
    "time_step": 0.1,
    "settings": {},
    "settings_sha256": "b" * 64,
    "starts": [[0.0, 0.0, 0.0], [1.0, 0.0, 3.0]],
    "noise_seed": 7,
    "goal": None,
    "steps": 10,
    "counted_cells": 100,
    "map_origin": [0.0, -1.0],
    "map_resolution": 0.05,
    "map_shape": [200, 4],
    "endings": [[3, "robot_0", "stopped"]],
    "interrupted": False,
    "final_sha256": None,
}


def test_a_good_header_passes_and_keys_that_are_not_known_are_left_alone():
    check_header(HEADER)
    check_header({**HEADER, "later": object(), "seed": 3, "goal": [1.0, 2.0], "final_sha256": "c" * 64})


@pytest.mark.parametrize("name", sorted(set(HEADER) - {"format"}))
def test_a_key_that_is_missing_is_named(name):
    with pytest.raises(ValueError, match=f"has no key {name}$"):
        check_header({key: value for key, value in HEADER.items() if key != name})


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"seed": -1}, "seed -1; want a whole number or null"),
        ({"robots": 65}, "robots 65; want a whole number from 1 to 64"),
        ({"robots": True}, "robots True"),
        ({"time_step": 0.0}, "time_step 0.0; want a number above 0"),
        ({"floor_sha256": "a" * 63}, "floor_sha256"),
        ({"goal": [1.0]}, "goal"),
        ({"map_origin": [0.0, float("nan")]}, "map_origin"),
        ({"map_shape": [MOST_MAP_WORDS, 2]}, "map_shape .* not too large"),
        ({"endings": [[1, "robot_0"]]}, "endings .* want a list of step, robot, reason"),
        ({"interrupted": 1}, "interrupted 1; want true or false"),
        ({"starts": [[0.0, 0.0, 0.0]]}, "1 starts for 2 robots"),
        ({"format": "1"}, "the number of its format"),
    ],
)
def test_a_bad_value_is_named_with_what_is_wanted(change, message):
    with pytest.raises(ValueError, match=message):
        check_header({**HEADER, **change})


def test_a_newer_format_asks_for_the_newer_version():
    with pytest.raises(NewerFormatError, match=f"of format {FORMAT + 1}, written by lidarium 9.0"):
        check_header({"format": FORMAT + 1, "version": "9.0"})
    with pytest.raises(ValueError, match="not an object"):
        check_header([HEADER])


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
    track = DisplayTrack(np.array([0.0, 0.2]), poses, np.array([[1.0, 0.25], [3.0, 0.5]]), (0.0, 0.0), 0.1, changes, [])
    assert track.poses_at(-1.0).tolist() == track.poses_at(0.1).tolist() == [[0.0, 1.0, 2.0]]
    assert track.poses_at(0.2).tolist() == track.poses_at(9.0).tolist() == [[3.0, 4.0, 5.0]]
    assert [track.coverage_at(time) for time in (0.5, 1.0, 2.9, 3.0, 9.0)] == [0.0, 0.25, 0.25, 0.5, 0.5]
