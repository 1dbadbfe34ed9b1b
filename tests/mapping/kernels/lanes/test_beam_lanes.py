"""Ranges of eight beams, lowered by a face, against their plain definition."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from lidarium.mapping.kernels.compilation import kernel
from lidarium.mapping.kernels.in_python import plain
from lidarium.mapping.kernels.lanes.beam_lanes import LANES, lower_lanes

numbers = st.floats(-20.0, 20.0)
lanes = arrays(np.float64, LANES, elements=numbers)


@kernel
def lower_at(inverses, directions, ranges, distance, span):
    lower_lanes(inverses, directions, ranges, distance, span[0], span[1], span[2])


@given(lanes, lanes, lanes, numbers, numbers, numbers, numbers)
def test_beams_that_meet_a_face_end_there(inverses, directions, ranges, distance, run, low, high):
    span = (run, min(low, high), max(low, high))
    expected = plain.lower_ranges(ranges, inverses, directions, distance, span)
    lower_at(inverses.ctypes.data, directions.ctypes.data, ranges.ctypes.data, distance, span)
    assert np.array_equal(ranges, expected)
