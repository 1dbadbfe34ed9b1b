"""Images as files: Pillow reads their headers before OpenCV decodes any pixel."""

import io
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.files.guarded_reading import READING_ERRORS, read_bytes, reading

if TYPE_CHECKING:
    from PIL.ImageFile import ImageFile

MAX_IMAGE_BYTES = 1 << 29
"""Longest file of a picture."""

IMAGE_SUFFIXES = (".png", ".pgm", ".bmp", ".jpg", ".jpeg", ".tif", ".tiff")
"""Endings of the names of pictures that can be read."""

MAX_PIXELS = 25_000_000
"""Most pixels of a picture, 5,000 x 5,000: a floor is made of them in a second and 300 MB."""

MAX_COLOURED = 12_000_000
"""Most pixels of a picture that may have colours, 4,000 x 3,000: they take twice as long."""

MIN_PIXELS, PIXELS_PER_BYTE = 1 << 22, 1000
"""Pixels that any image may have, and pixels for each byte of the file."""

_GREY = frozenset(("1", "L", "I", "I;16", "I;16B"))
"""Modes of Pillow with one channel, as PNG and PGM have them."""


def read_image(path: Path) -> NDArray[Any]:
    """Read an image file with all its channels.

    Returns
    -------
    (rows, columns) or (rows, columns, channels) uint8 or uint16
        The pixels, row 0 at the top, channels in OpenCV's order (blue first). White is the greatest number of
        the type, whatever the file calls white.
    """
    path = Path(path)
    content = read_bytes(path, MAX_IMAGE_BYTES)
    header = _header(content)
    pixels = None
    if header is not None:
        with reading(path, "an image that can be read"):
            _check_size(header, content)
        pixels = _decoded(content)
    if pixels is not None and pixels.dtype in (np.float32, np.float64):
        return _greys_of_floats(path, pixels)
    if pixels is None or pixels.dtype not in (np.uint8, np.uint16):
        raise ValueError(f"{path} is not an image that can be read; want png, pgm, bmp, jpg or tif")
    white, maximum = _unscaled_white(content), np.iinfo(pixels.dtype).max
    if white is None or white == maximum:
        return pixels
    return np.minimum(np.rint(pixels * (maximum / max(white, 1))), maximum).astype(pixels.dtype)


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
    """Return the white of a PGM or PPM that OpenCV does not scale; None for others.

    Pillow does not tell it.
    """
    if content[:2] not in (b"P2", b"P3", b"P5", b"P6"):
        return None
    words: list[bytes] = []
    for line in content[2:65536].splitlines():
        words += line.split(b"#")[0].split()
        if len(words) >= 3:
            break
    white = int(words[2])
    is_scaled = content[:2] in (b"P2", b"P3") and white <= 255
    return None if is_scaled else white


def _decoded(content: bytes) -> NDArray[Any] | None:
    """Return the pixels of an image; None if they are damaged."""
    if content[:2] in (b"P1", b"P2", b"P3"):
        # OpenCV does not read a number that the file ends with.
        content += b"\n"
    # OpenCV also prints what is wrong, beside the error that is raised here.
    level = cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    try:
        return cv2.imdecode(np.frombuffer(content, dtype=np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error:
        return None
    finally:
        cv2.utils.logging.setLogLevel(level)


def _check_size(header: "ImageFile", content: bytes) -> None:
    """Raise ValueError if an image is too large to be decoded."""
    width, height = header.size
    is_grey = header.mode in _GREY and header.format in ("PNG", "PPM")
    allowed = MAX_PIXELS if is_grey else MAX_COLOURED
    maximum = min(allowed, max(MIN_PIXELS, PIXELS_PER_BYTE * len(content)))
    if not (width > 0 and height > 0 and width * height <= maximum):
        raise ValueError(f"it has {width:,} x {height:,} pixels in {len(content):,} bytes; want at most {maximum:,}")


def _header(content: bytes) -> "ImageFile | None":
    """Return an image that is not decoded; None if its format is unknown or its header damaged."""
    # One class for each format: `Image.open` also tries others, and has a limit for the whole process.
    from PIL.BmpImagePlugin import BmpImageFile
    from PIL.JpegImagePlugin import JpegImageFile
    from PIL.PngImagePlugin import PngImageFile
    from PIL.PpmImagePlugin import PpmImageFile
    from PIL.TiffImagePlugin import TiffImageFile

    readers: dict[bytes, type[Any]] = {
        b"\x89PNG\r\n\x1a\n": PngImageFile,
        b"BM": BmpImageFile,
        b"\xff\xd8": JpegImageFile,
        b"II*\x00": TiffImageFile,
        b"MM\x00*": TiffImageFile,
        **{b"P%d" % k: PpmImageFile for k in range(1, 7)},
    }
    for magic, reader in readers.items():
        if content.startswith(magic):
            try:
                with warnings.catch_warnings(action="ignore"):  # damaged tags are skipped with a warning
                    header: ImageFile = reader(io.BytesIO(content))
            except (OSError, *READING_ERRORS):
                return None
            return header if reader is not PngImageFile or _has_whole_chunks(content) else None
    return None


def _has_whole_chunks(content: bytes) -> bool:
    """Whether no chunk of a PNG claims more bytes than the file has: OpenCV allocates them unseen."""
    position = 8
    while position + 8 <= len(content):
        length = int.from_bytes(content[position : position + 4], "big")
        if position + 8 + length > len(content):
            return False
        position += 12 + length
    return True
