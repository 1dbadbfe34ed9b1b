import os
import threading

import numpy as np
import pytest

from lidarium.benchmarks.speed.harness.timing import (
    Effort,
    compared,
    cores,
    interleaved,
    median_interval,
    on_cores,
    repeated,
)


def test_the_interval_of_fifteen_values_is_from_the_fourth_to_the_twelfth():
    interval = median_interval([float(value) for value in np.random.default_rng(0).permutation(15)])
    assert (interval.low, interval.median, interval.high) == (3.0, 7.0, 11.0)


def test_few_values_give_the_least_and_the_greatest():
    assert median_interval([3.0, 1.0, 2.0]).low == 1.0
    assert median_interval([3.0, 1.0, 2.0]).high == 3.0
    assert median_interval([5.0]).median == 5.0


def test_the_interval_holds_the_true_median_as_often_as_it_says():
    generator = np.random.default_rng(1)
    intervals = [median_interval(list(generator.exponential(size=15))) for _ in range(2000)]
    share = np.mean([each.low <= np.log(2.0) <= each.high for each in intervals])
    assert 0.95 <= share <= 0.98


def test_contenders_run_in_turn_after_a_round_to_warm_up():
    calls = []

    def contender(name):
        return lambda seconds: calls.append(name) or 1.0

    seconds = interleaved({"a": contender("a"), "b": contender("b")}, Effort(rounds=2, block_s=0.0))
    assert calls == ["a", "b"] * 3
    assert seconds == {"a": [1.0, 1.0], "b": [1.0, 1.0]}


def test_a_block_runs_at_least_once_and_begins_with_what_comes_before():
    calls = []
    assert repeated(lambda: calls.append("work"), 2, lambda: calls.append("before"))(0.0) > 0.0
    assert calls == ["before", "work"]


def test_ratios_are_taken_round_by_round():
    ratio = compared([1.0, 2.0, 1.0], [2.0, 2.0, 5.0])
    assert (ratio.median, ratio.least, ratio.greatest) == (2.0, 1.0, 5.0)


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="this system keeps no process on a core")
def test_threads_that_run_already_are_kept_on_the_cores_too():
    before, seen, stop = cores(), [], threading.Event()
    started, look = threading.Event(), threading.Event()

    def wait():
        started.set()
        look.wait()
        seen.append(sorted(os.sched_getaffinity(0)))
        stop.set()

    thread = threading.Thread(target=wait)
    thread.start()
    started.wait()
    with on_cores(1):
        look.set()
        stop.wait()
        assert cores() == before[-1:]
    thread.join()
    assert seen == [before[-1:]]
    assert cores() == before
