"""Kernels in plain Python see numbers as compiled ones do."""

import gc
from typing import NamedTuple

import numpy as np
import pytest

from lidarium.mapping.kernels.in_python.interpreted import Numbers, array_at, interpreted, room_for, widened


class Pair(NamedTuple):
    cells: np.ndarray
    count: int


@pytest.mark.parametrize(
    ("value", "kind"),
    [
        (np.int8(-3), int),
        (np.uint16(3), int),
        (np.bool_(True), bool),
        (np.uint64(3), np.uint64),
        (np.float32(0.1), np.float32),
        (0.1, np.float64),
        (3, int),
    ],
)
def test_numbers_have_the_width_that_kernels_count_with(value, kind):
    found = widened(value)
    assert type(found) is kind
    assert found == value


def test_elements_do_not_wrap_around_and_parts_stay_views():
    cells = np.array([[120, 7], [1, 2]], np.int8)
    seen = widened(cells)
    assert seen[0, 0] + seen[0, 0] == 240
    assert isinstance(seen[0], Numbers)
    seen[1][0] = 9
    assert cells[1, 0] == 9
    assert widened(seen) is seen


def test_members_of_tuples_are_widened_and_named_ones_keep_their_class():
    plain, named = widened((np.int8(1), 0.5)), widened(Pair(np.zeros(2, np.int8), np.int8(3)))
    assert [type(each) for each in plain] == [int, np.float64]
    assert isinstance(named, Pair)
    assert isinstance(named.cells, Numbers)
    assert type(named.count) is int


def test_a_kernel_run_by_python_divides_by_zero_as_compiled_ones_do():
    @interpreted
    def inverse(values, scale):
        return scale / values[0]

    assert inverse(np.zeros(1), 1.0) == np.inf
    assert inverse(np.zeros(1), scale=-1.0) == -np.inf


def test_arrays_are_viewed_at_their_addresses():
    cells = np.arange(6, dtype=np.int16)
    view = array_at(cells.ctypes.data, (2, 3), np.int16)
    view[1, 2] = 99
    assert cells[5] == 99
    assert array_at(0, (0, 3), np.int16).shape == (0, 3)


def test_a_room_lives_as_long_as_its_views():
    room = room_for(4, np.float64)
    view = array_at(room, (4,), np.float64)
    view[:] = [1.0, 2.0, 3.0, 4.0]
    del room
    gc.collect()
    others = [np.full(4, 7.0) for _ in range(50)]
    assert view.tolist() == [1.0, 2.0, 3.0, 4.0]
    assert len(others) == 50
