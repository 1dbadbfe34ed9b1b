"""Fields of messages as bytes of the common data representation."""

import numpy as np

from lidarium.mapping.files.bags.cdr import Cdr

HEAD = b"\x00\x01\x00\x00"


def test_numbers_begin_at_multiples_of_their_size():
    found = bytes(Cdr().numbers("I", 1).numbers("d", 0.5).numbers("i", -1))
    assert found == HEAD + b"\x01\0\0\0" + bytes(4) + b"\0\0\0\0\0\0\xe0\x3f" + b"\xff\xff\xff\xff"


def test_a_text_has_its_length_in_bytes_and_ends_with_a_zero():
    found = bytes(Cdr().text("é").numbers("f", 1.0))
    assert found == HEAD + b"\x03\0\0\0\xc3\xa9\0" + bytes(1) + b"\0\0\x80\x3f"


def test_an_array_has_its_length_and_its_numbers_lowest_byte_first():
    values = np.array([1.0, 2.0], ">f8")
    found = bytes(Cdr().array(values))
    assert found == HEAD + b"\x02\0\0\0" + bytes(4) + np.array([1.0, 2.0], "<f8").tobytes()
    assert bytes(Cdr().array(np.zeros(0))) == HEAD + bytes(4)
    strided = np.arange(6, dtype=np.int8)[::2]
    assert bytes(Cdr().array(strided)) == HEAD + b"\x03\0\0\0\x00\x02\x04"
