"""Interrupts within compiled code, which come out of it as errors of the system."""

import numpy as np
import pytest

import lidarium
from lidarium.mapping.kernels.interrupts import interruptible, is_wrapped_interrupt


def wrapped(error, times):
    for _ in range(times):
        outer = SystemError("<function> returned a result with an exception set")
        outer.__cause__ = error
        error = outer
    return error


def test_an_interrupt_is_found_through_the_errors_of_compiled_code():
    assert is_wrapped_interrupt(wrapped(KeyboardInterrupt(), 1))
    assert is_wrapped_interrupt(wrapped(KeyboardInterrupt(), 3))
    assert not is_wrapped_interrupt(SystemError("a defect"))
    assert not is_wrapped_interrupt(wrapped(ValueError("bad input"), 2))
    assert not is_wrapped_interrupt(ValueError("bad input"))


@pytest.mark.parametrize(
    ("error", "raised"),
    [
        (wrapped(KeyboardInterrupt(), 2), KeyboardInterrupt),
        (KeyboardInterrupt(), KeyboardInterrupt),
        (SystemError("a defect"), SystemError),
        (wrapped(ValueError("bad input"), 1), SystemError),
    ],
)
def test_only_interrupts_are_raised_as_such(error, raised):
    def fail(number, *, name):
        raise error

    with pytest.raises(raised):
        interruptible(fail)(1, name="a")
    assert interruptible(lambda number: number + 1)(1) == 2


def test_an_interrupted_step_raises_keyboard_interrupt(monkeypatch):
    envs = lidarium.vector_env(2, "apartment:7", level="tour", robots=1, resolution=0.1)
    envs.reset(seed=0)

    def interrupted(*given):
        raise wrapped(KeyboardInterrupt(), 2)

    monkeypatch.setattr(type(envs.batch.engine.level), "observe", interrupted)
    with pytest.raises(KeyboardInterrupt):
        envs.step(np.zeros(2, np.int64))
    envs.close()
