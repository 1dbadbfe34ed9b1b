"""Tiles hold their points; bounds on their boxes leave the labels of an exhaustive search."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from scattered_points import in_order, room, searched

from lidarium.mapping.sparse.quantisation.labelling import NO_SQUARES, label_points
from lidarium.mapping.sparse.quantisation.lloyd import nearest_codes
from lidarium.mapping.sparse.quantisation.tiles import tiles_of

COORDINATES = st.one_of(
    st.integers(-4, 4).map(float),
    st.floats(-1024.0, 1024.0, width=32),
    st.floats(-(2.0**-10), 2.0**-10, width=32),
)


def labelled(points, codes):
    """Return labels in the caller's order, with and without distances, and the distances."""
    tiles = tiles_of(points)
    nearest = nearest_codes(tiles, codes)
    labels, sums = np.empty_like(nearest.labels), np.empty((len(codes), 4))
    label_points(tiles, codes, labels, NO_SQUARES, sums)
    assert sums[:, 3].sum() == len(points)
    found = in_order(labels, tiles)
    for code in range(len(codes)):
        own = points[found == code].astype(np.float64)
        assert sums[code, :3] == pytest.approx(own.sum(axis=0), rel=1e-9, abs=1e-6)
    return found, in_order(nearest.labels, tiles), in_order(nearest.squares, tiles)


@given(
    arrays.arrays(np.float32, st.tuples(st.integers(1, 200), st.just(3)), elements=COORDINATES),
    arrays.arrays(np.float32, st.tuples(st.integers(1, 20), st.just(3)), elements=COORDINATES),
)
def test_labels_are_those_of_exhaustive_search_ties_included(points, codes):
    silent, told, squares = labelled(points, codes)
    wanted, wanted_squares = searched(points, codes)
    assert (silent == wanted).all()
    assert (told == wanted).all()
    assert (squares == wanted_squares).all()


@pytest.mark.parametrize("count", [1, 2, 40, 300])
def test_labels_on_a_room_are_those_of_exhaustive_search(count):
    points = room(20_000)
    codes = points[np.random.default_rng(1).choice(len(points), count, replace=False)]
    codes[-1] = codes[0]
    silent, told, _ = labelled(points, codes)
    wanted, _ = searched(points, codes)
    assert (silent == wanted).all()
    assert (told == wanted).all()
