import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lidarium.mapping.grids.growing_array import GrowingArray


@given(st.integers(0, 100))
def test_rows_are_those_that_came(count):
    array = GrowingArray((2,), np.float32)
    for k in range(count):
        array.append([k, 2 * k])
    assert len(array) == count
    assert array.rows.dtype == np.float32
    assert np.array_equal(array.rows, np.arange(count)[:, None] * np.array([[1.0, 2.0]], np.float32))


def test_rows_that_come_later_change_nothing_before():
    array = GrowingArray((), np.int64)
    array.append(7)
    before = array.rows
    for k in range(40):
        array.append(k)
    assert before.tolist() == [7]
    assert array.rows[:2].tolist() == [7, 0]


def test_a_row_of_another_shape_is_refused():
    array = GrowingArray((3,), np.float64)
    with pytest.raises(ValueError, match=r"row has shape \(2,\); want \(3,\)"):
        array.append(np.zeros(2))
    assert len(array) == 0
