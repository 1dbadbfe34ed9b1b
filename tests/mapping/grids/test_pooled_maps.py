"""Pooled maps are kept beside a map where it has changed."""

import numpy as np
from cropped_maps import pooled_levels
from hypothesis import given, settings
from hypothesis import strategies as st

from lidarium.mapping.grids.occupancy import three_levels
from lidarium.mapping.grids.pooled_maps import forget_touched, pool_touched, touch, untouched


@given(seed=st.integers(0, 10**6), scale=st.integers(2, 17), changes=st.integers(1, 6))
@settings(max_examples=60)
def test_a_pooled_map_kept_up_to_date_is_the_one_made_anew(seed, scale, changes):
    generator = np.random.default_rng(seed)
    log_odds = np.zeros((37, 192), np.int8)
    pooled, touched = np.zeros((-(-37 // scale), -(-192 // scale)), np.int8), untouched(37, 192)
    for _ in range(changes):
        row, word, height = generator.integers(0, 37), generator.integers(0, 3), generator.integers(1, 12)
        words = int(generator.integers(1, 4 - word))
        block = log_odds[row : row + height, 64 * word : 64 * (word + words)]
        block[:] = generator.integers(-40, 71, block.shape)
        touch(touched, (row, min(row + height, 37)), (word, word + words))
        pool_touched(log_odds, touched, scale, pooled)
        forget_touched(touched, 37)
        assert not touched.any()
    assert np.array_equal(three_levels(pooled), pooled_levels(log_odds, scale))


def test_touched_words_and_their_rows_are_marked_and_others_are_not():
    touched = untouched(130, 64 * 70)
    touch(touched, (64, 66), (62, 67))
    words = touched[:130]
    assert {
        (row, 64 * place + bit)
        for row, place in np.argwhere(words).tolist()
        for bit in range(64)
        if int(words[row, place]) >> bit & 1
    } == {(row, word) for row in (64, 65) for word in range(62, 67)}
    rows = touched[130:, 0].tolist()
    assert [bit for bit in range(130) if rows[bit // 64] >> bit % 64 & 1] == [64, 65]


def test_nothing_is_pooled_where_nothing_was_touched():
    log_odds, pooled = np.full((8, 64), 9, np.int8), np.full((2, 16), 5, np.int8)
    touched = untouched(8, 64)
    pool_touched(log_odds, touched, 4, pooled)
    assert (pooled == 5).all()
    touch(touched, (0, 1), (0, 1))
    pool_touched(log_odds, touched, 4, pooled)
    assert (pooled[0] > 0).all()
    assert (pooled[1] == 5).all()
