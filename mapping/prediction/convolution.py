"""Convolutions of images with a border of zeros.

Images are stored flat, row after row. A weight of a convolution is then applied to all pixels at once, by a shift of
the flat array. The border keeps the rows apart; values that are computed for the border are set to 0.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.simd.convolution import LANES, OUTPUTS, add_taps


@dataclass(frozen=True, slots=True)
class Image:
    """Channels of an image.

    Attributes
    ----------
    flat : (channels, length) float32
        Rows of the image with its border, and room for a last shift of LANES numbers.
    rows, columns : int
        Size without border.
    border : int
        Pixels of zeros on each side.
    phases : int
        1, or 4 if ``flat`` holds images of every second row and column, one after the other.
    """

    flat: NDArray[np.float32]
    rows: int
    columns: int
    border: int = 1
    phases: int = 1

    @classmethod
    def blank(cls, channels: int, rows: int, columns: int, border: int = 1, phases: int = 1) -> Self:
        """Return an image of zeros."""
        length = phases * (rows + 2 * border) * (columns + 2 * border) + LANES + 2 * border
        return cls(np.zeros((channels, length), np.float32), rows, columns, border, phases)

    @classmethod
    def of(cls, pixels: NDArray[np.float32], border: int = 1) -> Self:
        """Return an image of (channels, rows, columns)."""
        channels, rows, columns = pixels.shape
        made = cls.blank(channels, rows, columns, border)
        made.inner[:] = pixels
        return made

    @property
    def width(self) -> int:
        """Pixels of a row with its border."""
        return self.columns + 2 * self.border

    @property
    def whole(self) -> NDArray[np.float32]:
        """A view of the pixels and the border, (channels, phases * rows, columns)."""
        height = self.phases * (self.rows + 2 * self.border)
        return self.flat[:, : height * self.width].reshape(-1, height, self.width)

    @property
    def inner(self) -> NDArray[np.float32]:
        """A view of the pixels, (channels, rows, columns)."""
        return self.whole[:, self.border : self.border + self.rows, self.border : self.border + self.columns]

    @property
    def first(self) -> int:
        """Index of the first pixel in a channel."""
        return self.border * self.width + self.border

    def with_border(self, border: int) -> "Image":
        """Return the image with another border."""
        return self if border == self.border else Image.of(self.inner, border)

    def doubled(self) -> "Image":
        """Return the image with each pixel twice along rows and columns, and a border of 1."""
        made = Image.blank(len(self.flat), 2 * self.rows, 2 * self.columns)
        for row in (0, 1):
            for column in (0, 1):
                made.inner[:, row::2, column::2] = self.inner
        return made

    def halved(self) -> "Image":
        """Return what a convolution of every second row and column reads: its four phases, (row, column) modulo 2."""
        made = Image.blank(len(self.flat), self.rows // 2, self.columns // 2, phases=4)
        whole, height = self.whole, made.rows + 2
        for row in (0, 1):
            for column in (0, 1):
                phase = whole[:, row::2, column::2]
                begin = (2 * row + column) * height
                made.whole[:, begin : begin + phase.shape[1], : phase.shape[2]] = phase
        return made


@dataclass(frozen=True, slots=True)
class Layer:
    """A convolution.

    Attributes
    ----------
    weights : (groups, channels, side * side, OUTPUTS) float32
        Weights of all outputs, in groups; those that fill the last group are 0.
    bias : (groups * OUTPUTS,) float32
        What each output begins with.
    outputs : int
        Channels of the result.
    """

    weights: NDArray[np.float32]
    bias: NDArray[np.float32]
    outputs: int

    @classmethod
    def of(cls, weight: NDArray[np.float32], bias: NDArray[np.float32] | None) -> Self:
        """Return the layer with PyTorch's weights, (outputs, channels, side, side), and bias, (outputs,) or None."""
        outputs, channels = weight.shape[:2]
        groups = -(-outputs // OUTPUTS)
        weights = np.zeros((groups * OUTPUTS, channels, weight[0, 0].size), np.float32)
        weights[:outputs] = weight.reshape(outputs, channels, -1)
        begin = np.zeros(groups * OUTPUTS, np.float32)
        if bias is not None:
            begin[:outputs] = bias
        grouped = weights.reshape(groups, OUTPUTS, *weights.shape[1:]).transpose(0, 2, 3, 1)
        return cls(np.ascontiguousarray(grouped), begin, outputs)

    def __call__(
        self, image: Image, *, rectifies: bool = False, adds_input: bool = False, onto: Image | None = None
    ) -> Image:
        """Return the convolution of an image, of its size; of an image in four phases, of every second pixel.

        Parameters
        ----------
        image : Image
            The input. The dilation of a 3 x 3 convolution is the width of its border.
        rectifies : bool, default False
            Whether negative numbers become 0.
        adds_input : bool, default False
            Whether the image itself is added at last.
        onto : Image, optional
            The result is added to these pixels, in place, before it is rectified.
        """
        channels = len(self.bias)
        made = Image.blank(channels, image.rows, image.columns, image.border) if onto is None else onto
        taps = _taps(image, self.weights.shape[2])
        count = image.rows * image.width
        _convolve(image.flat, taps, self.weights, self.bias, made.first, count, rectifies, adds_input, made.flat)
        made.whole[:, -made.border :] = 0.0
        made.whole[:, :, : made.border] = 0.0
        made.whole[:, :, -made.border :] = 0.0
        if channels == self.outputs:
            return made
        return Image(made.flat[: self.outputs], made.rows, made.columns, made.border)


def _taps(image: Image, count: int) -> NDArray[np.int64]:
    """Return the offset of each weight's input pixel [bytes]; the first output pixel reads at these offsets."""
    if count == 1:
        return np.array([4 * image.first], np.int64)
    row, column = np.divmod(np.arange(9), 3)
    if image.phases == 1:
        return np.asarray(4 * image.border * (row * image.width + column), np.int64)
    phase = 2 * (row % 2) + column % 2
    shift = (phase * (image.rows + 2) + row // 2) * image.width + column // 2
    return np.asarray(4 * shift, np.int64)


@kernel
def _convolve(
    source: Array,
    taps: Array,
    weights: Array,
    bias: Array,
    first: int,
    count: int,
    rectifies: bool,
    adds_input: bool,
    result: Array,
) -> None:
    """Add a convolution of a flat image to a result, block by block.

    Parameters
    ----------
    source : (channels, length) float32
        Flat image.
    taps : (shifts,) int64
        Shifts of its weights [bytes].
    weights : (groups, channels, shifts, OUTPUTS) float32
        Weights.
    bias : (groups * OUTPUTS,) float32
        Added to each output.
    first : int
        Index of the first pixel of the result, and of the source if that is added.
    count : int
        Number of pixels, the border between rows included.
    rectifies : bool
        Whether negative sums become 0.
    adds_input : bool
        Whether the source is added at last; it has as many channels then.
    result : (groups * OUTPUTS, length) float32
        Has the sums added. Up to LANES - 1 numbers after the last pixel have no meaning.
    """
    least = 0.0 if rectifies else -np.inf
    for block in range((count + LANES - 1) // LANES):
        begin = block * LANES
        at = first + begin
        for group in range(len(weights)):
            last = source.ctypes.data + group * OUTPUTS * source.strides[0] + 4 * at
            add_taps(
                result.ctypes.data + group * OUTPUTS * result.strides[0] + 4 * at,
                result.strides[0],
                source.ctypes.data + 4 * begin,
                source.strides[0],
                len(source),
                taps.ctypes.data,
                len(taps),
                weights.ctypes.data + group * weights.strides[0],
                bias.ctypes.data + group * OUTPUTS * bias.itemsize,
                least,
                last if adds_input else 0,
            )
