"""Loops on threads that share out their turns do each piece of work once."""

import numba
import numpy as np
import pytest

from lidarium.mapping.kernels.compilation import available_threads, kernel, use_threads
from lidarium.mapping.kernels.work_queue import new_queue, take_next


@kernel
def work_through(turns, worker, counts, workers):
    turn = take_next(turns)
    while turn < counts.shape[0]:
        counts[turn] += 1
        workers[turn] = worker
        # Pieces of very different length.
        for _ in range(turn % 7 * 1000):
            counts[turn] ^= 0
        turn = take_next(turns)


@kernel(parallel=True)
def share_out(turns, threads, counts, workers):
    for worker in numba.prange(threads):
        work_through(turns, worker, counts, workers)


@pytest.mark.parametrize("threads", [1, 2, 3])
def test_every_piece_is_done_once_whoever_does_it(threads):
    use_threads(min(threads, available_threads()))
    for pieces in (0, 1, 5, 10_000):
        counts, workers = np.zeros(pieces, np.int64), np.full(pieces, -1)
        share_out(new_queue(), threads, counts, workers)
        assert np.all(counts == 1)
        assert np.all((workers >= 0) & (workers < threads))


def test_turns_are_taken_in_order_by_one_thread():
    counts, workers, turns = np.zeros(9, np.int64), np.zeros(9, np.int64), new_queue()
    work_through(turns, 0, counts, workers)
    assert counts.tolist() == [1] * 9
    assert turns[0] == 10
