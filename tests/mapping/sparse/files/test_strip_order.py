"""Places come back from strips, in which neighbours are near."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from lidarium.mapping.sparse.files.strip_order import places_of_strips, strip_columns, strip_order


def sorted_rows(values):
    return values[np.lexsort(values.T)]


@given(arrays(np.int64, st.tuples(st.integers(0, 30), st.just(3)), elements=st.integers(-(10**8), 10**8)))
def test_places_come_back_from_strips(places):
    origin = np.full(3, -(10**8))
    ordered = places[strip_order(places, origin)]
    columns = strip_columns(ordered, origin)
    assert (columns >= 0).all()
    np.testing.assert_array_equal(places_of_strips(columns, origin), ordered)
    np.testing.assert_array_equal(sorted_rows(ordered), sorted_rows(places))


def test_neighbours_are_near_in_strips():
    places = np.stack(np.meshgrid(*[np.arange(0, 200, 10)] * 2, [5]), axis=-1).reshape(-1, 3)
    steps = np.diff(places[strip_order(places, np.zeros(3, np.int64))], axis=0)
    assert np.abs(steps[:, 0]).max() == 10
    assert np.abs(steps[:, 1]).max() == 30
