import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from page_reader import maps_of, plain_numbers, signed_numbers, unpacked

from lidarium.evaluation.report.page.packing import changed_runs, packed, signed_varints, varints


@given(st.lists(st.integers(0, 2**35 - 1)))
def test_numbers_come_back(numbers):
    assert plain_numbers(varints(numbers)) == numbers


@given(st.lists(st.integers(-(2**34), 2**34 - 1)))
def test_numbers_with_a_sign_come_back(numbers):
    assert signed_numbers(signed_varints(numbers)) == numbers


def test_a_small_number_takes_one_byte():
    assert varints([0, 127]) == b"\x00\x7f"
    assert varints([128, 300]) == b"\x80\x01\xac\x02"  # the examples of the format's definition


@given(st.lists(st.lists(st.integers(0, 2), min_size=12, max_size=12), min_size=1, max_size=6))
def test_maps_come_back_sample_by_sample(samples):
    before, stream = np.zeros((3, 4), np.uint8), b""
    for sample in samples:
        after = np.array(sample, np.uint8).reshape(3, 4)
        stream += changed_runs(before, after)
        before = after
    assert np.array_equal(maps_of(stream, 3, 4), np.array(samples).reshape(-1, 3, 4))


def test_a_map_that_stays_takes_one_byte():
    levels = np.ones((50, 50), np.uint8)
    assert changed_runs(levels, levels) == b"\x00"


def test_a_run_of_cells_takes_few_bytes():
    before, after = np.zeros((10, 10), np.uint8), np.zeros((10, 10), np.uint8)
    after[2:4] = 1
    assert plain_numbers(changed_runs(before, after)) == [1, 20, 20, 1]


@pytest.mark.parametrize("words", ["plain", "</script><b>", "ü \u2028"])
def test_header_and_streams_come_back(words):
    text = packed({"name": words}, {"a": b"\x00\x01", "empty": b"", "b": b"<"})
    assert "<" not in text
    header, streams = unpacked(text)
    assert header["name"] == words
    assert streams == {"a": b"\x00\x01", "empty": b"", "b": b"<"}
