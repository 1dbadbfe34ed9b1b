"""Rows that are not seen repeat their last observation."""

from types import SimpleNamespace

import numpy as np
import pytest
from gymnasium import spaces

from lidarium.envs.engine.observation_buffers import ObservationBuffers


def buffers(copy):
    writer = SimpleNamespace(buffers=lambda: {"scan": np.zeros((3, 2), np.float32)})
    return ObservationBuffers(writer, 3, {"gains": spaces.Box(0.0, 1.0, (4,), np.float32)}, copy)


@pytest.mark.parametrize("copy", [True, False])
def test_what_is_not_written_is_what_it_was(copy):
    made, seen = buffers(copy), np.array([True, False, True])
    assert made.latest["gains"].shape == (3, 4)
    made.latest["scan"][:] = [[1], [2], [3]]
    before = made.latest
    made.turn(seen, is_same_step=False)
    assert made.latest is not before
    assert made.latest["scan"][1].tolist() == [2.0, 2.0]
    made.latest["scan"][seen] = 9.0
    assert before["scan"][:, 0].tolist() == [1.0, 2.0, 3.0]


def test_two_sets_take_turns_and_copies_are_new_each_time():
    for copy, count in ((False, 2), (True, 5)):
        made, kept = buffers(copy), []
        for _ in range(5):
            made.turn(np.ones(3, bool), is_same_step=False)
            kept.append(made.latest)
        assert len({id(one) for one in kept}) == count


def test_a_step_that_goes_on_is_written_over():
    made = buffers(copy=False)
    made.turn(np.ones(3, bool), is_same_step=False)
    before = made.latest
    made.turn(np.array([True, False, False]), is_same_step=True)
    assert made.latest is before
