"""Weights of the reward are finite numbers by name."""

import math
from dataclasses import fields

import pytest

from lidarium.envs.settings.rewards import RewardSettings


@pytest.mark.parametrize("weight", [field.name for field in fields(RewardSettings)])
@pytest.mark.parametrize("value", [math.inf, math.nan])
def test_weights_of_the_reward_are_finite(weight, value):
    with pytest.raises(ValueError, match=weight):
        RewardSettings(**{weight: value})


def test_a_mapping_of_more_terms_becomes_pairs_that_can_be_compared():
    made = RewardSettings(more={"new_goal": 2.0})
    assert made.more == (("new_goal", 2.0),)
    assert made == RewardSettings(more=[["new_goal", 2.0]])
    assert hash(made) == hash(RewardSettings(more=(("new_goal", 2.0),)))


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (3, "more of the reward is 3"),
        ([("a",)], "want a mapping of names to weights"),
        ({"a": math.inf}, "weight a of the reward is inf"),
        ({"a": "much"}, "weight a of the reward is 'much'"),
    ],
)
def test_what_is_no_mapping_of_weights_is_refused(more, message):
    with pytest.raises(ValueError, match=message):
        RewardSettings(more=more)
