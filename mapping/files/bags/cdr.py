"""Messages of ROS 2 as bytes: the common data representation (CDR), lowest byte first.

References
----------
Object Management Group, DDS Interoperability Wire Protocol, section 10 (plain CDR).
"""

import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

_LITTLE_ENDIAN = b"\x00\x01\x00\x00"


class Cdr:
    """Puts the fields of a message one after the other; numbers begin at multiples of their size."""

    def __init__(self) -> None:
        self._bytes = bytearray()

    def __bytes__(self) -> bytes:
        return _LITTLE_ENDIAN + bytes(self._bytes)

    def numbers(self, code: str, *values: float) -> "Cdr":
        """Put numbers of one kind, as `struct` names it: ``f``, ``d``, ``i`` or ``I``."""
        self._align(struct.calcsize(code))
        self._bytes += struct.pack(f"<{len(values)}{code}", *values)
        return self

    def text(self, value: str) -> "Cdr":
        """Put a text."""
        content = value.encode() + b"\0"
        self.numbers("I", len(content))
        self._bytes += content
        return self

    def array(self, values: NDArray[Any]) -> "Cdr":
        """Put an array of any length."""
        self.numbers("I", values.size)
        if values.size:
            self._align(values.itemsize)
            self._bytes += np.ascontiguousarray(values, values.dtype.newbyteorder("<")).tobytes()
        return self

    def _align(self, size: int) -> None:
        self._bytes += bytes(-len(self._bytes) % size)
