"""Observations as one vector, with the mask inside, beside or apart."""

import numpy as np
import pytest
from gymnasium import spaces

from lidarium.envs.faces.conventions import (
    MASK,
    Conventions,
    ObservationForm,
    flat_box,
    flat_columns,
    shared_rewards,
)

BOXES = {
    "scan": spaces.Box(0.0, 5.0, (4,), np.float32),
    "map": spaces.Box(0, 255, (2, 3), np.uint8),
    MASK: spaces.Box(0, 1, (3,), np.int8),
}


def observation(seed, rows=()):
    generator = np.random.default_rng(seed)
    return {
        name: generator.uniform(box.low, box.high, (*rows, *box.shape)).astype(box.dtype) for name, box in BOXES.items()
    }


def form(observation, mask):
    return ObservationForm(spaces.Dict(BOXES), Conventions(observation=observation, action_mask=mask))


def test_columns_say_where_each_part_lies():
    parts = {name: BOXES[name] for name in ("map", "scan")}
    assert flat_columns(parts) == (("map", 0, 6), ("scan", 6, 10))
    seen, made = observation(2), form("flat", "infos")
    vector = made.of(seen)
    for name, first, last in made.columns:
        assert np.array_equal(vector[first:last], seen[name].ravel().astype(np.float32))
    assert flat_box(parts).high.tolist() == [255.0] * 6 + [5.0] * 4


def test_a_mask_that_is_not_there_cannot_be_beside():
    boxes = {"scan": BOXES["scan"]}
    with pytest.raises(ValueError, match="action_mask is 'beside', but observations have none"):
        ObservationForm(spaces.Dict(boxes), Conventions(action_mask="beside"))
    with pytest.raises(ValueError, match="nothing is observed beside the mask"):
        ObservationForm(spaces.Dict({MASK: BOXES[MASK]}), Conventions(action_mask="infos"))


def test_a_share_of_each_reward_is_the_mean_of_those_who_acted():
    rewards = np.array([[1.0, 3.0, 100.0], [2.0, 4.0, 6.0], [5.0, 5.0, 5.0]])
    acted = np.array([[True, True, False], [True, True, True], [False, False, False]])
    found = shared_rewards(rewards, acted, 0.25)
    assert found[0].tolist() == [0.75 * 1.0 + 0.5, 0.75 * 3.0 + 0.5, 0.0]
    assert found[1].tolist() == [2.5, 4.0, 5.5]
    assert found[2].tolist() == [0.0, 0.0, 0.0]
