"""Teams of any size look like the largest."""

import numpy as np
import pytest
from gymnasium import spaces

from lidarium.envs.faces.randomized import Draws, check_spaces, padded
from lidarium.envs.settings.making import make_settings

ACTION = spaces.Box(-1.0, 1.0, (2,), np.float32)


def largest_team(sizes):
    return Draws(make_settings(), {"robots": sizes}).max_robots


def fits_into(seen, largest):
    try:
        check_spaces({}, (seen, ACTION), (largest, ACTION))
    except ValueError:
        return False
    return True


def space(robots, beams=5):
    return spaces.Dict(
        {
            "scan": spaces.Box(0.0, 1.0, (beams,), np.float32),
            "teammates": spaces.Box(-1.0, 1.0, (robots - 1, 8), np.float32),
        }
    )


def test_the_largest_team_is_that_of_the_largest_number():
    assert largest_team((1, 4)) == 4
    assert largest_team([3, 7, 2]) == 7


@pytest.mark.parametrize("distribution", [3, (1.0, 4.0), (0, 3), [True], "many", lambda generator: 3])
def test_sizes_that_cannot_be_known_are_refused(distribution):
    with pytest.raises(ValueError, match="the distribution of robots is"):
        largest_team(distribution)


def test_observations_fit_but_for_rows_of_teammates():
    assert fits_into(space(2), space(4))
    assert not fits_into(space(4), space(2))
    assert not fits_into(space(2, beams=4), space(4))
    assert not fits_into(spaces.Dict({"scan": space(2)["scan"]}), space(4))


def test_teammates_that_are_not_there_are_zeros():
    seen = {"scan": np.ones(5, np.float32), "teammates": np.ones((1, 8), np.float32)}
    found = padded(seen, space(4))
    assert found["scan"] is seen["scan"]
    assert found["teammates"].tolist() == [[1.0] * 8, [0.0] * 8, [0.0] * 8]
    assert space(4).contains(found)
