"""A network that predicts which unknown squares of a partial map are free.

It is a small U-Net: windows are seen at four scales, and what is found at the coarse ones goes into the fine ones.

References
----------
O. Ronneberger, P. Fischer and T. Brox, "U-Net: convolutional networks for biomedical image segmentation", 2015;
pixels as channels and back: W. Shi et al., "Real-time single image and video super-resolution using an efficient
sub-pixel convolutional neural network", 2016; sums past layers: K. He et al., "Deep residual learning for image
recognition", 2016.
"""

from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.files.weight_files import WeightFiles, Weights
from lidarium.mapping.prediction.convolution import Image, Layer
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
def _shipped() -> Weights:
    return FILES.load()


def load_weights(path: str | Path = "") -> Weights:
    """Return the weights of a file; if ``path`` is empty, the package's."""
    return FILES.load(path) if path != "" else _shipped()


class MapNetwork:
    """A network with its weights.

    Parameters
    ----------
    weights : dict of str to array
        Its weights by name, as ``shapes`` has them.
    """

    def __init__(self, weights: Weights) -> None:
        self._layers = {
            name.removesuffix(".weight"): Layer.of(weight, weights.get(name.replace(".weight", ".bias")))
            for name, weight in weights.items()
            if name.endswith(".weight")
        }

    def __call__(self, levels: NDArray[np.int8]) -> NDArray[np.float32]:
        """Return the probability that each square of a window is free, (WINDOW, WINDOW) float32.

        Parameters
        ----------
        levels : (WINDOW, WINDOW) int8
            Squares of the map; beyond it they are unknown.
        """
        # In float64, as the last bit of an exponential in float32 differs by processor.
        logits = np.clip(self.logits(levels), -30.0, 30.0).astype(np.float64)
        return np.asarray(1.0 / (1.0 + np.exp(-logits)), np.float32)

    def logits(self, levels: NDArray[np.int8]) -> NDArray[np.float32]:
        """Return the logarithms of the odds that squares are free, (WINDOW, WINDOW) float32."""
        layers = self._layers
        seen = np.stack([levels == OCCUPIED, levels == FREE]).astype(np.float32)
        x = layers["enter"](Image.of(_to_channels(seen)), rectifies=True)
        kept: list[Image] = []
        for scale in range(len(WIDTHS) - 1):
            x = layers[f"level{scale}"](x, rectifies=True, adds_input=True)
            kept.append(x)
            x = layers[f"down{scale}"](x.halved(), rectifies=True)
        for number, dilation in enumerate(DILATIONS):
            x = layers[f"coarse{number}"](x.with_border(dilation), rectifies=True, adds_input=True)
        for scale in reversed(range(len(WIDTHS) - 1)):
            deep = layers[f"deep{scale}"](x).doubled()
            x = layers[f"skip{scale}"](kept[scale], rectifies=True, onto=deep)
            x = layers[f"merge{scale}"](x, rectifies=True, adds_input=True)
        return np.asarray(_to_pixels(layers["out"](x).inner)[0])


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
