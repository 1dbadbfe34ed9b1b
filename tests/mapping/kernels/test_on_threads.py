"""Parallel loops that call a serial kernel by its address do what the kernel does."""

from typing import NamedTuple

import numba
import numpy as np
import pytest

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.on_threads import call_at, on_threads
from lidarium.mapping.kernels.work_queue import Work, new_work, share_of, take_next


class _Line(NamedTuple):
    values: Array
    slope: float


@kernel
def _stretch(line: _Line, out: Array, work: Work) -> None:
    """Stretch the items of the work, and note the thread that did."""
    for thread in range(work.first, work.first + work.threads):
        k = take_next(work.taken)
        while k < len(work.items):
            item = work.items[k]
            out[item, 0], out[item, 1] = line.slope * line.values[item], thread
            k = take_next(work.taken)


@kernel(parallel=True)
def _stretch_on_threads(address: int, line: _Line, out: Array, work: Work) -> None:
    for thread in numba.prange(work.threads):
        call_at(address, (line, out, share_of(work, thread)))


@pytest.mark.parametrize("is_writeable", [True, False])
def test_all_items_are_worked_off_whatever_the_types_of_arguments(is_writeable):
    values, out = np.arange(50.0), np.full((50, 2), -1.0)
    values.flags.writeable = is_writeable  # another type to numba, and so another address
    on_threads(_stretch, _stretch_on_threads)(_Line(values, 2.0), out, new_work(np.arange(50), 3))
    assert np.array_equal(out[:, 0], 2.0 * values)
    assert set(out[:, 1]) <= {0.0, 1.0, 2.0}
    serial = np.empty_like(out)
    _stretch(_Line(values, 2.0), serial, new_work(np.arange(50), 1))
    assert np.array_equal(serial[:, 0], out[:, 0])
    assert not serial[:, 1].any()
