"""Options of a reset are checked, those of others let pass."""

import math

import numpy as np
import pytest

from lidarium.envs.settings.reset_options import (
    ResetOptions,
    check_options,
    checked_seed,
    of_curriculum,
    of_number,
    read_options,
)


def test_reset_options_that_are_unknown_are_ignored_and_known_ones_checked():
    assert read_options(None, 2) == read_options({}, 2)
    assert read_options({"colour": "red"}, 2).floor is None
    chosen = read_options({"starts": [[1, 2, 3], [4, 5, 6]], "goal": [1, 2], "floor": "clinic"}, 2)
    assert chosen.goal == (1.0, 2.0)
    assert chosen.floor == "clinic"
    assert np.array_equal(chosen.starts, [[1, 2, 3], [4, 5, 6]])


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"starts": [[1.0, 2.0, 3.0]]}, r"starts has shape \(1, 3\); want \(2, 3\)"),
        ({"starts": [[1.0, 2.0], [1.0, 2.0]]}, "want"),
        ({"starts": [[math.nan, 0, 0], [1, 1, 1]]}, "starts"),
        ({"goal": (math.inf, 0.0)}, "goal"),
    ],
)
def test_reset_options_with_bad_values_are_refused(options, words):
    with pytest.raises(ValueError, match=words):
        read_options(options, 2)


def test_a_slip_of_the_pen_is_no_option_of_others():
    check_options({"colour": "red", "floor": "clinic"})
    with pytest.raises(ValueError, match="unknown reset option 'flor'; did you mean 'floor'"):
        check_options({"flor": "clinic"})
    with pytest.raises(ValueError, match="options of reset are 3; want a dict"):
        check_options(3)


def test_words_for_starts_are_kept():
    assert read_options({"starts": "drawn"}, 3).starts == "drawn"
    with pytest.raises(ValueError, match="option starts is 'anywhere'"):
        read_options({"starts": "anywhere"}, 3)


@pytest.mark.parametrize("seed", [-1, 1.0, True, "1"])
def test_seeds_are_whole_numbers_from_0_on(seed):
    with pytest.raises(ValueError, match="seed is"):
        checked_seed(seed)
    assert checked_seed(None) is None
    assert type(checked_seed(np.int64(3))) is int


def test_what_is_chosen_for_an_episode_goes_before_its_curriculum():
    def curriculum(number):
        return {"floor": f"building:{number}", "goal": (1.0, 2.0)}

    found = of_curriculum(curriculum, 4, ResetOptions(goal=(3.0, 3.0)), 1)
    assert (found.floor, found.goal) == ("building:4", (3.0, 3.0))
    assert of_curriculum(None, 4, found, 1) is found
    assert of_number(curriculum, 2)["floor"] == "building:2"
    assert of_number(None, 2) == {}


def test_a_bad_curriculum_is_named_with_its_episode():
    with pytest.raises(ValueError, match="the curriculum of episode 7: option goal is"):
        of_curriculum(lambda number: {"goal": "far"}, 7, ResetOptions(), 1)
