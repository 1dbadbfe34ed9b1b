"""A first signal is noted and waits for the end of a step; a second one raises."""

import os
import signal

import pytest

from lidarium.evaluation.episodes.interrupts import (
    PatientInterrupt,
    Termination,
    is_end_asked,
    is_wrapped_interrupt,
)

pytestmark = pytest.mark.skipif(os.name == "nt", reason="signals are sent as on Unix")


def test_a_patient_interrupt_notes_a_first_termination_and_raises_at_the_second():
    termination = Termination()
    before = signal.signal(signal.SIGTERM, termination)
    try:
        with PatientInterrupt() as interrupt:
            assert not interrupt.is_asked
            signal.raise_signal(signal.SIGTERM)
            assert interrupt.is_asked
            assert termination.is_asked
            with pytest.raises(KeyboardInterrupt):
                signal.raise_signal(signal.SIGTERM)
        assert signal.getsignal(signal.SIGTERM) is termination
    finally:
        signal.signal(signal.SIGTERM, before)


@pytest.fixture
def ctrl_c():
    """Python's own handler, whatever the process began with."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("ctrl_c")
def test_all_who_wait_within_learn_of_the_end_until_the_context_is_left():
    assert not is_end_asked()
    with PatientInterrupt():
        assert not is_end_asked()
        signal.raise_signal(signal.SIGINT)
        with PatientInterrupt():
            assert is_end_asked()
    assert not is_end_asked()
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


@pytest.mark.usefixtures("ctrl_c")
def test_signals_within_the_grace_are_one_wish():
    with PatientInterrupt(grace_s=600.0) as interrupt:
        for _ in range(3):
            signal.raise_signal(signal.SIGINT)
        assert interrupt.is_asked


def test_a_handler_of_an_application_is_left_alone():
    heard = []
    before = signal.signal(signal.SIGINT, lambda number, frame: heard.append(number))
    try:
        with PatientInterrupt() as interrupt:
            signal.raise_signal(signal.SIGINT)
            assert not interrupt.is_asked
    finally:
        signal.signal(signal.SIGINT, before)
    assert heard == [signal.SIGINT]


def test_an_interrupt_is_found_through_the_errors_of_compiled_code():
    def wrapped(error, times):
        for _ in range(times):
            outer = SystemError("<function> returned a result with an exception set")
            outer.__cause__ = error
            error = outer
        return error

    assert is_wrapped_interrupt(wrapped(KeyboardInterrupt(), 1))
    assert is_wrapped_interrupt(wrapped(KeyboardInterrupt(), 3))
    assert not is_wrapped_interrupt(SystemError("a defect"))
    assert not is_wrapped_interrupt(wrapped(ValueError("bad input"), 2))
    assert not is_wrapped_interrupt(ValueError("bad input"))
