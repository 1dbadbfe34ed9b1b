"""The garbage collector stands still while files are parsed, and goes on after."""

import gc
import threading

import pytest

from lidarium.mapping.files.guarded_reading import reading


@pytest.fixture(autouse=True)
def collecting():
    gc.enable()
    yield
    gc.enable()


def test_it_pauses_within_readings_and_goes_on_behind_the_outermost():
    with reading(None, "a file"):
        with reading(None, "a part of it"):
            assert not gc.isenabled()
        assert not gc.isenabled()
    assert gc.isenabled()


def test_it_goes_on_after_an_error():
    with pytest.raises(ValueError, match="damaged"), reading(None, "a file"):
        raise ValueError("damaged")
    assert gc.isenabled()


def test_who_has_turned_it_off_keeps_it_off():
    gc.disable()
    with reading(None, "a file"):
        pass
    assert not gc.isenabled()


def test_of_threads_that_read_at_once_the_last_lets_it_go_on():
    entered, leave = threading.Event(), threading.Event()

    def read():
        with reading(None, "a file"):
            entered.set()
            leave.wait(10.0)

    thread = threading.Thread(target=read)
    with reading(None, "another file"):
        thread.start()
        assert entered.wait(10.0)
    assert not gc.isenabled()
    leave.set()
    thread.join()
    assert gc.isenabled()
