"""Observations, rewards, infos and ends in the forms that trainers want, alone and in batches."""

import re

import gymnasium
import numpy as np
import pytest
from conventional_teams import make


def test_the_level_of_frontiers_alone_has_masks():
    for place in ("beside", "infos"):
        with pytest.raises(ValueError, match=f"action_mask is '{place}', but observations have none"):
            make(action_mask=place)
    solo = gymnasium.make("lidarium/FrontierExploration-v1", floor="scene_room", observation="flat").unwrapped
    observation, _ = solo.reset(seed=0)
    assert solo.action_masks().dtype == np.bool_
    assert np.array_equal(solo.action_masks(), observation[:33] == 1.0)
    with pytest.raises(AttributeError, match="level of frontiers only"):
        gymnasium.make("lidarium/Exploration-v1", floor="scene_room").unwrapped.action_masks()


@pytest.mark.parametrize(
    ("option", "value"),
    [("observation", "box"), ("infos", True), ("ended_agents", "stay"), ("action_mask", None)],
)
def test_unknown_forms_are_refused_with_the_known_ones(option, value):
    with pytest.raises(ValueError, match=re.escape(f"{option} is {value!r}")):
        make(**{option: value})


def test_a_share_beyond_the_whole_is_refused():
    with pytest.raises(ValueError, match=r"team_reward is 1\.5"):
        make(team_reward=1.5)
