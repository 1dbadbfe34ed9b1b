"""Errors of episodes, with the episode's name."""

import pytest

from lidarium.evaluation.processes import WorkerDiedError
from lidarium.training.failures import raise_named


@pytest.mark.parametrize("error", [ValueError("no room"), WorkerDiedError("no room")])
def test_bad_input_and_dead_workers_are_values_that_cannot_be_used(error):
    with pytest.raises(ValueError, match="the episode x failed: no room; what was finished") as raised:
        raise_named(error, "the episode x")
    assert raised.value.__cause__ is error


def test_defects_stay_what_they_are_with_a_note():
    error = ZeroDivisionError("by zero")
    with pytest.raises(ZeroDivisionError) as raised:
        raise_named(error, "the episode x")
    assert raised.value is error
    assert "the episode x failed" in error.__notes__[0]
