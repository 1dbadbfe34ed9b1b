"""Plain forms take addresses as compiled operations do, and do what the plain definitions say."""

import numpy as np

from lidarium.mapping.kernels.in_python import plain, plain_forms

GENERATOR = np.random.default_rng(6)


def block(low=-100, high=100):
    return GENERATOR.integers(low, high, 64).astype(np.int8)


def test_words_have_a_first_and_a_last_bit():
    for word in (1, 0b1011000, 2**63, 2**64 - 1):
        bits = [place for place in range(64) if word >> place & 1]
        assert plain_forms.first_bit(np.uint64(word)) == bits[0]
        assert plain_forms.last_bit(np.uint64(word)) == bits[-1]
    assert plain_forms.running_xor(np.uint64(0b100100)) == np.uint64(0b11100)


def test_a_block_is_updated_in_place():
    cells, (seen, hits) = block(-20, 30), (0b1111 << 8, 0b1010 << 8)
    expected, changed = plain.update_block(cells.copy(), seen, hits, (9, 4), (-20, 30))
    found = plain_forms.update_block(cells.ctypes.data, np.uint64(seen), np.uint64(hits), 9, 4, -20, 30)
    np.testing.assert_array_equal(cells, expected)
    assert found == np.uint64(changed)


def test_sums_and_signs_are_of_the_blocks_at_their_addresses():
    first, second, result = block(), block(), np.zeros(64, np.int8)
    plain_forms.sum_blocks(first.ctypes.data, second.ctypes.data, result.ctypes.data)
    np.testing.assert_array_equal(result, np.clip(first.astype(int) + second, -127, 127))
    assert plain_forms.negative_cells(first.ctypes.data) == np.uint64(plain.bits_of(first < 0))
    assert plain_forms.positive_cells(first.ctypes.data) == np.uint64(plain.bits_of(first > 0))


def test_numbers_are_raised_to_those_of_another_block():
    numbers, others = (GENERATOR.integers(0, 500, 64).astype(np.uint16) for _ in range(2))
    expected = np.maximum(numbers, others)
    plain_forms.raise_block(numbers.ctypes.data, others.ctypes.data)
    np.testing.assert_array_equal(numbers, expected)
    others[7] += 1
    same = plain_forms.same_cells(numbers.ctypes.data, others.ctypes.data)
    assert same == np.uint64(plain.bits_of(numbers == others))


def test_views_share_the_memory_of_arrays():
    cells = np.arange(12, dtype=np.float64)
    plain_forms.vector_view(cells.ctypes.data, 12, np.float64)[3] = -1.0
    plain_forms.grid_view(cells.ctypes.data, 3, 4, np.float64)[2, 1] = -2.0
    assert (cells[3], cells[9]) == (-1.0, -2.0)
