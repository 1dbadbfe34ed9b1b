"""Weighted sums of shifted rows of numbers."""

import numpy as np
import pytest
from both_forms import assert_forms_agree

from lidarium.mapping.kernels.simd.convolution import LANES, OUTPUTS, add_taps


@pytest.mark.parametrize(("channels", "count"), [(1, 1), (3, 9), (5, 4)])
@pytest.mark.parametrize(("least", "adds_last"), [(-np.inf, False), (0.0, False), (0.0, True), (-np.inf, True)])
def test_sums_are_those_of_plain_python(channels, count, least, adds_last):
    generator = np.random.default_rng(channels)

    def whole(*shape):  # sums of small integers are exact in any order
        return generator.integers(-9, 10, shape).astype(np.float32)

    sums, source, bias = whole(OUTPUTS, LANES + 7), whole(max(channels, OUTPUTS), 3 * LANES), whole(OUTPUTS)
    weights, taps = whole(channels, count, OUTPUTS), 4 * generator.integers(0, 2 * LANES, count)
    last = source.ctypes.data + 20 if adds_last else 0
    row, channel = sums.strides[0], source.strides[0]
    found = assert_forms_agree(add_taps, sums, row, source, channel, channels, taps, count, weights, bias, least, last)[
        1
    ]
    wanted = sums[:, :LANES] + bias[:, None]
    for k in range(channels):
        for tap, shift in enumerate(taps // 4):
            wanted += weights[k, tap, :, None] * source[k, shift : shift + LANES]
    wanted = np.maximum(wanted, least) + (source[:OUTPUTS, 5 : 5 + LANES] if adds_last else 0.0)
    np.testing.assert_array_equal(found[:, :LANES], wanted)
    np.testing.assert_array_equal(found[:, LANES:], sums[:, LANES:])
