"""Ranges of eight beams and inverse depths of sixteen pixels, changed by a face."""

import numpy as np
from both_forms import assert_forms_agree
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from lidarium.mapping.kernels.simd.faces import BEAMS, LINES, PIXELS, bound_columns, lower_ranges, raise_pixels

numbers = st.floats(-20.0, 20.0)
lanes = arrays(np.float64, BEAMS, elements=numbers)


@given(lanes, lanes, lanes, numbers, numbers, numbers, numbers)
def test_beams_that_meet_a_face_end_there(inverses, directions, ranges, distance, run, low, high):
    span = run, min(low, high), max(low, high)
    assert_forms_agree(lower_ranges, inverses, directions, ranges, distance, *span)


def test_a_beam_ends_at_the_face_that_it_meets_first():
    ranges, ahead = np.array([9.0, 1.0, 9.0, 9.0, 9.0, 9.0, 9.0, 9.0]), np.ones(BEAMS)
    ahead[2] = -1.0
    found = assert_forms_agree(lower_ranges, ahead, np.arange(BEAMS) / 2.0, ranges, 2.0, 0.0, 0.0, 4.0)[3]
    assert found.tolist() == [2.0, 1.0, 9.0, 2.0, 2.0, 9.0, 9.0, 9.0]


def test_pixels_are_raised_between_two_indices():
    generator = np.random.default_rng(0)
    for _ in range(300):
        pixels = generator.uniform(0.0, 1.0, PIXELS).astype(np.float32)
        start, slope = np.float32(generator.uniform(0.0, 1.0)), np.float32(generator.uniform(-0.1, 0.1))
        first, last = (int(number) for number in generator.integers(-20, 36, 2))
        assert_forms_agree(raise_pixels, pixels, start, slope, first, last)
    ramp = assert_forms_agree(raise_pixels, np.ones(PIXELS, np.float32), np.float32(0), np.float32(1), 1, 3)
    assert ramp[1].tolist() == [1.0, 1.0, 2.0, 3.0] + [1.0] * 12


def test_columns_of_scan_lines_lie_within_all_edges():
    generator = np.random.default_rng(0)
    for _ in range(300):
        edges = generator.normal(0.0, 40.0, (2, 4, 2))
        edges[generator.random((2, 4)) < 0.4] = 0.0, 0.0
        first, last = np.zeros(LINES, np.int32), np.zeros(LINES, np.int32)
        assert_forms_agree(bound_columns, edges, float(generator.integers(0, 48)), 64.0, first, last)


def test_columns_end_with_the_image_and_with_the_nearest_edge():
    edges = np.zeros((2, 4, 2))
    edges[0, :, 0], edges[1, :, 0] = -1e300, 1e300
    edges[0, 1], edges[1, 2] = (2.5, 1.0), (4.0, 0.5)
    begins, ends = (np.zeros(LINES, np.int32) for _ in range(2))
    found = assert_forms_agree(bound_columns, edges, 2.0, 7.0, begins, ends)
    assert found[2].tolist() == [5, 6, 7, 7, 7, 7, 7, 7]
    assert found[3].tolist() == [5, 5, 6, 6, 6, 6, 6, 6]
