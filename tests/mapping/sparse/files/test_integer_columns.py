"""Columns of numbers come back from their blocks, which have codes of their own."""

import zlib

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from lidarium.mapping.sparse.files.integer_columns import column_blocks, deflated, lists_of_columns


@given(
    st.lists(
        arrays(np.int64, st.tuples(st.integers(0, 9), st.integers(1, 6)), elements=st.integers(0, 2**32 - 1)),
        min_size=1,
    )
)
def test_columns_come_back(lists):
    blocks = column_blocks(lists)
    content = zlib.decompress(deflated(blocks))
    assert content == b"".join(blocks)
    assert len(content) == 4 * sum(each.size for each in lists)
    counts, widths = zip(*(each.shape for each in lists), strict=True)
    for found, expected in zip(lists_of_columns(content, counts, widths), lists, strict=True):
        np.testing.assert_array_equal(found, expected)


def test_columns_of_unlike_numbers_have_codes_of_their_own():
    rng = np.random.default_rng(0)
    unlike = np.stack([rng.integers(0, 4, 2000), 100 + rng.integers(0, 64, 2000)], axis=1)
    blocks = column_blocks([unlike])
    together = zlib.compress(b"".join(blocks), 9)
    assert len(deflated(blocks)) < 0.9 * len(together)
