"""Kernels in plain Python see numbers as compiled ones do."""

from typing import NamedTuple

import numpy as np
import pytest

from lidarium.mapping.kernels.compilation import Numbers, _interpreted, _widened


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
    found = _widened(value)
    assert type(found) is kind
    assert found == value


def test_elements_do_not_wrap_around_and_parts_stay_views():
    cells = np.array([[120, 7], [1, 2]], np.int8)
    seen = _widened(cells)
    assert seen[0, 0] + seen[0, 0] == 240
    assert isinstance(seen[0], Numbers)
    seen[1][0] = 9
    assert cells[1, 0] == 9
    assert _widened(seen) is seen


def test_members_of_tuples_are_widened_and_named_ones_keep_their_class():
    plain, named = _widened((np.int8(1), 0.5)), _widened(Pair(np.zeros(2, np.int8), np.int8(3)))
    assert [type(each) for each in plain] == [int, np.float64]
    assert isinstance(named, Pair)
    assert isinstance(named.cells, Numbers)
    assert type(named.count) is int


def test_a_kernel_run_by_python_divides_by_zero_as_compiled_ones_do():
    @_interpreted
    def inverse(values, scale):
        return scale / values[0]

    assert inverse(np.zeros(1), 1.0) == np.inf
    assert inverse(np.zeros(1), scale=-1.0) == -np.inf
