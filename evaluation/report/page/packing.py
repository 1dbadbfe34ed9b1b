"""Packs whole numbers and maps over time into few bytes.

``evaluation/report/web/src/replay/unpacking.ts`` reads them.
"""

import base64
import json
import struct
import zlib
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

_BITS, _MOST_BYTES = 7, 5


def varints(values: ArrayLike) -> bytes:
    """Return whole numbers from 0 to 2^35 - 1 in groups of seven bits, the lowest first (LEB128)."""
    numbers = np.asarray(values, np.uint64).ravel()
    groups = (numbers[:, None] >> np.arange(0, _BITS * _MOST_BYTES, _BITS, dtype=np.uint64)) & np.uint64(127)
    sizes = np.ones(len(numbers), np.int64)
    for size in range(1, _MOST_BYTES):
        sizes[numbers >= 1 << (_BITS * size)] = size + 1
    places = np.arange(_MOST_BYTES)
    groups |= np.where(places < sizes[:, None] - 1, np.uint64(128), np.uint64(0))
    return groups[places < sizes[:, None]].astype(np.uint8).tobytes()


def signed_varints(values: ArrayLike) -> bytes:
    """Return whole numbers with a sign as `varints`: 0, -1, 1, -2 and so on become 0, 1, 2, 3."""
    numbers = np.asarray(values, np.int64).ravel()
    return varints((numbers << 1) ^ (numbers >> 63))


def changed_runs(before: NDArray[np.uint8], after: NDArray[np.uint8]) -> bytes:
    """Return what turns one map into another of the same shape, as runs of cells with one new value.

    The number of runs; then of each the cells that are skipped, the cells that it has, and their value.
    """
    old, new = before.ravel(), after.ravel()
    cells = np.flatnonzero(old != new)
    if not len(cells):
        return varints([0])
    values = new[cells].astype(np.int64)
    first = np.flatnonzero(np.r_[True, (np.diff(cells) != 1) | (np.diff(values) != 0)])
    lengths = np.diff(np.r_[first, len(cells)])
    starts = cells[first]
    skipped = starts - np.r_[0, (starts + lengths)[:-1]]
    return varints(np.r_[len(first), np.stack([skipped, lengths, values[first]], axis=1).ravel()])


def packed(header: Mapping[str, Any], streams: Mapping[str, bytes]) -> str:
    """Return a header and named streams as text: base64 of deflated bytes.

    Before that: the size of the header in bytes (4 bytes, lowest first), the header as JSON with the names
    and sizes of the streams, and the streams one after the other.
    """
    whole = {**header, "streams": [[name, len(stream)] for name, stream in streams.items()]}
    text = json.dumps(whole, allow_nan=False, separators=(",", ":")).encode()
    content = b"".join([struct.pack("<I", len(text)), text, *streams.values()])
    return base64.b64encode(zlib.compress(content, 9)).decode()
