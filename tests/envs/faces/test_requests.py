"""Requests to a batch are for all episodes or for each."""

import numpy as np
import pytest

from lidarium.envs.faces.requests import episodes_of, options_of, seeds_of


def test_one_seed_counts_on_by_episode():
    assert seeds_of(5, 3) == [5, 6, 7]
    assert seeds_of([4, None, 9], 3) == [4, None, 9]
    assert seeds_of(None, 2) == [None, None]
    assert seeds_of(np.array([1, 2]), 2) == [1, 2]
    with pytest.raises(ValueError, match="seed has 2 entries; want one number, or one entry for each of the 3"):
        seeds_of([1, 2], 3)
    for bad in (-1, "12", [0, -1, 2]):
        with pytest.raises(ValueError, match="seed is"):
            seeds_of(bad, 3)


def test_a_mask_chooses_episodes():
    assert episodes_of(None, 3).tolist() == [0, 1, 2]
    assert episodes_of({"episodes": np.array([True, False, True])}, 3).tolist() == [0, 2]
    assert episodes_of({"reset_mask": np.array([False, False, True, True])}, 2, robots=2).tolist() == [1]
    for mask in ([True, False, True, True], [True, False]):
        with pytest.raises(ValueError, match="want 4 booleans, one for each row, the same for all robots"):
            episodes_of({"reset_mask": np.array(mask)}, 2, robots=2)
    with pytest.raises(ValueError, match="episodes and reset_mask are given; want one of them"):
        episodes_of({"reset_mask": np.ones(2, bool), "episodes": np.ones(2, bool)}, 2)
    for bad in ([False, False, False], [True, True], [1, 0, 1]):
        with pytest.raises(ValueError, match="want a mask of 3 booleans, at least one of them True"):
            episodes_of({"episodes": bad}, 3)
    with pytest.raises(ValueError, match="did you mean 'episodes'"):
        episodes_of({"episode": [True]}, 1)


STARTS = [[1.0, 2.0, 0.0], [3.0, 4.0, 0.5]]


def test_options_are_for_all_or_for_each():
    chosen = np.array([0, 2])
    alike = options_of({"starts": STARTS, "goal": (1.0, 2.0), "floor": "clinic"}, chosen, 3, 2)
    assert list(alike) == [0, 2]
    assert all(option.goal == (1.0, 2.0) and option.floor == "clinic" for option in alike.values())
    each = options_of(
        {"starts": [STARTS, None, "drawn"], "goal": [None, (0.0, 0.0), (1.0, 1.0)], "floor": ["a", "b", "c"]},
        chosen,
        3,
        2,
    )
    assert np.array_equal(each[0].starts, STARTS)
    assert (each[0].goal, each[0].floor) == (None, "a")
    assert (each[2].starts, each[2].goal, each[2].floor) == ("drawn", (1.0, 1.0), "c")
    assert options_of(None, chosen, 3, 2) == {}


def test_as_many_entries_as_there_are_not_episodes_are_refused():
    with pytest.raises(ValueError, match="option floor has 2 entries; want one for all, or one for each of the 3"):
        options_of({"floor": ["a", "b"]}, np.array([0]), 3, 2)


def test_words_and_poses_may_be_given_for_each_episode():
    for starts in (["fixed", "drawn"], ["drawn", None], [np.zeros((2, 3)), "drawn"]):
        options = options_of({"starts": starts}, np.arange(2), 2, 2)
        assert [options[k].starts is None for k in range(2)] == [each is None for each in starts]
    one = options_of({"starts": "fixed"}, np.arange(2), 2, 2)
    assert one[0].starts == one[1].starts == "fixed"
