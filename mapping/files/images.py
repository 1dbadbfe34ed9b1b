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
        The pixels, row 0 at the top, channels in OpenCV's order (blue first). White is the greatest number of
        the type, whatever the file calls white.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If it is a folder, not an image, or of float pixels that are neither shares nor greys.
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
    if pixels is not None and pixels.dtype in (np.float32, np.float64):
        return _greys_of_floats(path, pixels)
    if pixels is None or pixels.dtype not in (np.uint8, np.uint16):
        raise ValueError(f"{path} is not an image that can be read; want png, pgm, bmp, jpg or tif")
    white, most = _unscaled_white(content), np.iinfo(pixels.dtype).max
    if white is None or white == most:
        return pixels
    return np.minimum(np.rint(pixels * (most / max(white, 1))), most).astype(pixels.dtype)


def _greys_of_floats(path: Path, pixels: NDArray[Any]) -> NDArray[np.uint16]:
    """Return the greys of float pixels, which are shares of white or greys to 255."""
    low, high = float(pixels.min()), float(pixels.max())
    if not (np.isfinite(pixels).all() and low >= 0.0 and high <= 255.0):
        raise ValueError(
            f"{path} has float pixels from {low:g} to {high:g}; want 0 to 1 or 0 to 255, or greys of 8 bits"
        )
    white = 1.0 if high <= 1.0 else 255.0
    # Of whole greys of 8 bits, thresholds at a grey hold as in such an image.
    return (np.rint(pixels * (255.0 / white)) * 257.0).astype(np.uint16)


def _unscaled_white(content: bytes) -> int | None:
    """Return what is white in the pixels of a PGM or PPM that OpenCV leaves as they are; None in others."""
    if content[:2] not in (b"P2", b"P3", b"P5", b"P6"):
        return None
    white = _pnm_numbers(content, 3)[2]
    is_scaled = content[:2] in (b"P2", b"P3") and white <= 255
    return None if is_scaled else white


def _decoded(content: bytes) -> NDArray[Any] | None:
    """Return the pixels of a picture whose header is known; None where it is not or cannot be read."""
    if picture_size(content) is None:
        return None
    if content[:2] in (b"P1", b"P2", b"P3"):
        # OpenCV reads no last number that the file ends with.
        content += b"\n"
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
    """Return the size of a PBM, PGM or PPM."""
    width, height = _pnm_numbers(content, 2)
    return width, height


def _pnm_numbers(content: bytes, count: int) -> list[int]:
    """Return the first numbers of a PBM, PGM or PPM among remarks: width, height, and what is white."""
    numbers: list[int] = []
    for line in content[2:65536].splitlines():
        numbers += [int(word) for word in line.split(b"#")[0].split()[: count - len(numbers)]]
        if len(numbers) == count:
            return numbers
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
