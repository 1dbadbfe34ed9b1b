"""A network that predicts which unknown squares of a partial map are free, in plain numpy.

It is a small U-Net: windows are seen at four scales, and what is found at the coarse ones goes into the fine ones.

References
----------
O. Ronneberger, P. Fischer and T. Brox, "U-Net: convolutional networks for biomedical image segmentation", 2015;
pixels as channels and back: W. Shi et al., "Real-time single image and video super-resolution using an efficient
sub-pixel convolutional neural network", 2016; sums past layers: K. He et al., "Deep residual learning for image
recognition", 2016.
"""

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import ThreadpoolController

from lidarium.mapping.files.weight_files import WeightFiles, Weights
from lidarium.mapping.prediction.levels import FREE, OCCUPIED

WINDOW = 160
"""Squares along a window: 32 m."""

WIDTHS = (24, 48, 96, 128)
"""Channels of each scale, the finest first; its cells are 2, 4, 8 and 16 squares wide."""

DILATIONS = (1, 2)
"""Of the layers at the coarsest scale."""

PIXEL = 2
"""Squares along a cell of the finest scale."""


def shapes() -> dict[str, tuple[int, ...]]:
    """Return the shape of every array of weights, by name; the names are PyTorch's."""
    table: dict[str, tuple[int, ...]] = {}

    def layer(name: str, inputs: int, outputs: int, side: int, has_bias: bool = True) -> None:
        table[f"{name}.weight"] = (outputs, inputs, side, side)
        if has_bias:
            table[f"{name}.bias"] = (outputs,)

    layer("enter", 2 * PIXEL**2, WIDTHS[0], 3)
    for scale in range(len(WIDTHS) - 1):
        layer(f"level{scale}", WIDTHS[scale], WIDTHS[scale], 3)
        layer(f"down{scale}", WIDTHS[scale], WIDTHS[scale + 1], 3)
        layer(f"deep{scale}", WIDTHS[scale + 1], WIDTHS[scale], 1, has_bias=False)
        layer(f"skip{scale}", WIDTHS[scale], WIDTHS[scale], 1)
        layer(f"merge{scale}", WIDTHS[scale], WIDTHS[scale], 3)
    for number in range(len(DILATIONS)):
        layer(f"coarse{number}", WIDTHS[-1], WIDTHS[-1], 3)
    layer("out", WIDTHS[0], PIXEL**2, 1)
    return table


FILES = WeightFiles(shapes(), "lidarium.mapping.prediction", "prediction.safetensors.xz", "prediction.json")
"""Files of this network's weights."""


@lru_cache(maxsize=1)
def _blas() -> ThreadpoolController:
    return ThreadpoolController()


@lru_cache(maxsize=1)
def _shipped() -> Weights:
    return FILES.load()


def load_weights(path: str | Path = "") -> Weights:
    """Return the weights of a file; if ``path`` is empty, the package's."""
    return FILES.load(path) if path != "" else _shipped()


@dataclass(frozen=True, slots=True)
class MapNetwork:
    """A network with its weights."""

    weights: Weights

    def __call__(self, levels: NDArray[np.int8]) -> NDArray[np.float32]:
        """Return the probability that each square of a window is free, (WINDOW, WINDOW) float32.

        Parameters
        ----------
        levels : (WINDOW, WINDOW) int8
            Squares of the map; beyond it they are unknown.
        """
        logits = self.logits(levels)
        return np.asarray(1.0 / (1.0 + np.exp(-np.clip(logits, -30.0, 30.0))), np.float32)

    def logits(self, levels: NDArray[np.int8]) -> NDArray[np.float32]:
        """Return the logarithms of the odds that squares are free, (WINDOW, WINDOW) float32."""
        # Threads of BLAS wait for each other in loops: beside other work they took five times the time of one.
        with _blas().limit(limits=1, user_api="blas"):
            return self._logits(levels)

    def _logits(self, levels: NDArray[np.int8]) -> NDArray[np.float32]:
        seen = np.stack([levels == OCCUPIED, levels == FREE]).astype(np.float32)
        x = np.maximum(self._layer("enter", _to_channels(seen)), 0.0)
        kept: list[NDArray[np.float32]] = []
        for scale in range(len(WIDTHS) - 1):
            x = self._residual(f"level{scale}", x)
            kept.append(x)
            x = np.maximum(self._layer(f"down{scale}", x, stride=2), 0.0)
        for number, dilation in enumerate(DILATIONS):
            x = self._residual(f"coarse{number}", x, dilation)
        for scale in reversed(range(len(WIDTHS) - 1)):
            deep = self._layer(f"deep{scale}", x).repeat(2, axis=1).repeat(2, axis=2)
            deep += self._layer(f"skip{scale}", kept[scale])
            x = self._residual(f"merge{scale}", np.maximum(deep, 0.0, out=deep))
        return np.asarray(_to_pixels(self._layer("out", x))[0])

    def _residual(self, name: str, x: NDArray[np.float32], dilation: int = 1) -> NDArray[np.float32]:
        change = self._layer(name, x, dilation=dilation)
        np.maximum(change, 0.0, out=change)
        change += x
        return change

    def _layer(self, name: str, x: NDArray[np.float32], stride: int = 1, dilation: int = 1) -> NDArray[np.float32]:
        """Return a convolution of (channels, rows, columns), as one product of matrices."""
        weight, bias = self.weights[f"{name}.weight"], self.weights.get(f"{name}.bias")
        outputs, inputs, side, _ = weight.shape
        rows, columns = x.shape[1] // stride, x.shape[2] // stride
        if side == 1:
            pieces = x.reshape(inputs, -1)
        else:
            padded = np.zeros((inputs, x.shape[1] + 2 * dilation, x.shape[2] + 2 * dilation), np.float32)
            padded[:, dilation:-dilation, dilation:-dilation] = x
            pieces = np.empty((inputs, side, side, rows, columns), np.float32)
            for i in range(side):
                for j in range(side):
                    row, column = i * dilation, j * dilation
                    pieces[:, i, j] = padded[
                        :, row : row + rows * stride : stride, column : column + columns * stride : stride
                    ]
            pieces = pieces.reshape(inputs * side * side, -1)
        found = weight.reshape(outputs, -1) @ pieces
        if bias is not None:
            found += bias[:, None]
        return np.asarray(found.reshape(outputs, rows, columns))


def _to_channels(x: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the pixels of each cell as channels, as ``pixel_unshuffle`` of PyTorch."""
    channels, rows, columns = x.shape
    parts = x.reshape(channels, rows // PIXEL, PIXEL, columns // PIXEL, PIXEL).transpose(0, 2, 4, 1, 3)
    return np.ascontiguousarray(parts.reshape(channels * PIXEL**2, rows // PIXEL, columns // PIXEL))


def _to_pixels(x: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the inverse, as ``pixel_shuffle``."""
    channels, rows, columns = x.shape[0] // PIXEL**2, x.shape[1], x.shape[2]
    parts = x.reshape(channels, PIXEL, PIXEL, rows, columns).transpose(0, 3, 1, 4, 2)
    return np.ascontiguousarray(parts.reshape(channels, rows * PIXEL, columns * PIXEL))
