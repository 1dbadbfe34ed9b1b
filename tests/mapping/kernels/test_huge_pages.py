"""Memory for the maps of many robots is blank, apart, and taken only where it is touched."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from lidarium.mapping.kernels.huge_pages import LARGE_PAGE, LARGEST_PIECE, PIECE, ArrayPool
from lidarium.mapping.kernels.views import LINE


def test_arrays_of_pages_are_blank_apart_and_begin_on_lines():
    pages = ArrayPool()
    kinds = [
        ((3, 64), np.int8),
        ((0, 2), np.uint64),
        ((7, 5), np.uint64),
        ((PIECE + 1,), np.uint8),
        ((2, 2), np.int8),
    ]
    arrays = [pages.blank(shape, kind) for shape, kind in kinds]
    for k, (array, (shape, kind)) in enumerate(zip(arrays, kinds, strict=True)):
        assert array.shape == shape
        assert array.dtype == kind
        assert array.flags.carray
        assert array.ctypes.data % LINE == 0 or not array.size
        assert not array.any()
        array[...] = k + 1
    assert [set(array.ravel().tolist()) for array in arrays] == [{1}, set(), {3}, {4}, {5}]


FORKS = """
import os
import numpy as np
from lidarium.mapping.kernels.huge_pages import ArrayPool
array = ArrayPool().blank((4, 64), np.int8)
array[0] = 5
if os.fork() == 0:
    array[...] = 7
    os._exit(0)
os.wait()
print(array.sum())
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes do not fork here")
def test_a_fork_has_maps_of_its_own():
    # In a process of its own: this one may have threads.
    told = subprocess.run([sys.executable, "-c", FORKS], capture_output=True, text=True, check=True)
    assert told.stdout.strip() == str(5 * 64)


def resident():
    status = Path("/proc/self/status").read_text()
    return next(int(line.split()[1]) * 1024 for line in status.splitlines() if line.startswith("VmRSS"))


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="the system does not tell how much memory is in use")
@pytest.mark.parametrize("expected", [0, LARGEST_PIECE])
def test_what_is_not_touched_takes_no_room(expected):
    before = resident()
    pages = ArrayPool(expected)
    arrays = [pages.blank((64, 2**20), np.uint8), pages.blank((2**18,), np.uint8)]
    arrays[0][0, 0] = arrays[1][0] = 1
    assert resident() - before <= 4 * LARGE_PAGE


def test_large_arrays_leave_the_rest_of_a_piece_to_others():
    pages = ArrayPool()
    small, _large, next_one = (pages.blank((size,), np.uint8) for size in (LINE, PIECE, LINE))
    assert next_one.ctypes.data - small.ctypes.data == LINE
