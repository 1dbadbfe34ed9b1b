"""A bad header of a record is named before anything is made of it."""

import pytest

from lidarium.evaluation.record.episode_record import FORMAT, MOST_MAP_WORDS, NewerFormatError, check_header

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
