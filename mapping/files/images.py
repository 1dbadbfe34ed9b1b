"""Pictures as files: their sizes are found from headers before any pixel is asked for."""

import struct
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.files.guarded_reading import read_bytes, reading

MOST_IMAGE_BYTES = 1 << 29
"""Longest file of a picture."""

MOST_PIXELS = 25_000_000
"""Most pixels of a picture, 5,000 x 5,000: a floor is made of them in a second and 300 MB."""

MOST_COLOURED = 12_000_000
"""Most pixels of a picture that may have colours, 4,000 x 3,000: they take twice as long."""

LEAST_PIXELS, PIXELS_PER_BYTE = 1 << 22, 1000
"""A picture may have the first many pixels, and so many for each of its bytes: none is packed closer."""

_JPEG_SIZES = (*range(0xC0, 0xC4), *range(0xC5, 0xC8), *range(0xC9, 0xCC), *range(0xCD, 0xD0))


def read_image(path: Path) -> NDArray[Any]:
    """Read an image file with all its channels.

    Parameters
    ----------
    path : Path
        Any format that OpenCV reads (png, pgm, bmp, jpg, tif, ...).

    Returns
    -------
    (rows, columns) or (rows, columns, channels) uint8 or uint16
        The pixels, row 0 at the top, channels in OpenCV's order (blue first).

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If it is a folder or not an image.
    """
    path = Path(path)
    content = read_bytes(path, MOST_IMAGE_BYTES)
    if picture_size(content) is not None:
        with reading(path, "an image that can be read"):
            check_picture_size(content)
    try:
        pixels = _decoded(content)
    except cv2.error:
        pixels = None
    if pixels is None or pixels.dtype not in (np.uint8, np.uint16):
        raise ValueError(f"{path} is not an image that can be read; want png, pgm, bmp, jpg or tif")
    return pixels


def _decoded(content: bytes) -> NDArray[Any] | None:
    """Return the pixels of a picture whose header is known; None where it is not or cannot be read."""
    if picture_size(content) is None:
        return None
    return cv2.imdecode(np.frombuffer(content, dtype=np.uint8), cv2.IMREAD_UNCHANGED)


def check_picture_size(content: bytes) -> None:
    """Check that a picture is of a known format and not too large to be unpacked.

    Raises
    ------
    ValueError
        Where it is not.
    """
    size = picture_size(content)
    if size is None:
        raise ValueError("it is no picture that is known; want png, pgm, bmp, jpg or tif")
    width, height = size
    allowed = MOST_COLOURED if _may_have_colours(content) else MOST_PIXELS
    most = min(allowed, max(LEAST_PIXELS, PIXELS_PER_BYTE * len(content)))
    if not (width > 0 and height > 0 and width * height <= most):
        raise ValueError(
            f"it has {width:,} x {height:,} pixels in {len(content):,} bytes; want at most {most:,}"
        )


def picture_size(content: bytes) -> tuple[int, int] | None:
    """Return width and height of a picture; None where its format is not known or its header damaged."""
    try:
        if content[:8] == b"\x89PNG\r\n\x1a\n":
            return _png(content)
        if content[:2] == b"BM":
            return _bmp(content)
        if content[:1] == b"P" and content[1:2] in b"123456":
            return _pnm(content)
        if content[:2] == b"\xff\xd8":
            return _jpeg(content)
        if content[:4] in (b"II*\x00", b"MM\x00*"):
            return _tiff(content)
    except (struct.error, ValueError, IndexError):
        return None
    return None


def _may_have_colours(content: bytes) -> bool:
    """Whether a picture whose format is known may have more than one channel."""
    is_grey_png = content[:4] == b"\x89PNG" and content[25:26] == b"\0"
    return not is_grey_png and content[:2] not in (b"P1", b"P2", b"P4", b"P5")


def _png(content: bytes) -> tuple[int, int]:
    """Return the size of a PNG none of whose chunks claims more bytes than the file has."""
    place = 8
    while place + 8 <= len(content):
        (length,) = struct.unpack(">I", content[place : place + 4])
        if place + 8 + length > len(content):
            raise ValueError("a chunk is longer than the file")
        place += 12 + length
    width, height = struct.unpack(">II", content[16:24])
    return width, height


def _bmp(content: bytes) -> tuple[int, int]:
    if struct.unpack("<I", content[14:18])[0] == 12:
        width, height = struct.unpack("<HH", content[18:22])
        return width, height
    width, height = struct.unpack("<ii", content[18:26])
    return abs(width), abs(height)


def _pnm(content: bytes) -> tuple[int, int]:
    """Return the size of a PBM, PGM or PPM: two numbers among remarks."""
    numbers: list[int] = []
    for line in content[2:65536].splitlines():
        numbers += [int(word) for word in line.split(b"#")[0].split()[: 2 - len(numbers)]]
        if len(numbers) == 2:
            return numbers[0], numbers[1]
    raise ValueError("no size")


def _jpeg(content: bytes) -> tuple[int, int]:
    """Return the size that the first frame header says; segments before it are passed over."""
    place = 2
    while place + 9 <= len(content):
        if content[place] != 0xFF:
            raise ValueError("no marker")
        marker = content[place + 1]
        if marker in _JPEG_SIZES:
            height, width = struct.unpack(">HH", content[place + 5 : place + 9])
            return width, height
        stands_alone = marker in (0x01, 0xFF) or 0xD0 <= marker <= 0xD8
        step = 0 if stands_alone else struct.unpack(">H", content[place + 2 : place + 4])[0]
        place += (1 if marker == 0xFF else 2) + step
    raise ValueError("no frame")


def _tiff(content: bytes) -> tuple[int, int]:
    """Return the size that the first directory says."""
    order = "<" if content[:2] == b"II" else ">"
    (start,) = struct.unpack(f"{order}I", content[4:8])
    (count,) = struct.unpack(f"{order}H", content[start : start + 2])
    found: dict[int, int] = {}
    for k in range(count):
        tag, kind = struct.unpack(f"{order}HH", content[start + 2 + 12 * k : start + 6 + 12 * k])
        place = start + 10 + 12 * k
        if tag in (256, 257):
            width = 2 if kind == 3 else 4
            found[tag] = struct.unpack(f"{order}{'H' if kind == 3 else 'I'}", content[place : place + width])[
                0
            ]
    return found[256], found[257]
