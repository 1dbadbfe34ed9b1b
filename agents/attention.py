"""Attention over tokens without PyTorch, as in PyTorch's ``AttentionLayer`` of a training.

References
----------
A. Vaswani et al., "Attention is all you need", 2017; normalisation before each part: R. Xiong et al., "On
layer normalization in the transformer architecture", 2020.
"""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.files.weight_files import Weights
from lidarium.mapping.kernels.products import product

WIDTH, HEADS, LAYERS, INNER = 64, 4, 2, 128
"""Numbers a token has; heads and layers of attention; inner numbers of a layer."""

EPSILON = 1e-5
"""Added to variances before they divide."""

Shapes = dict[str, tuple[int, ...]]


def linear_shapes(name: str, inputs: int, outputs: int = WIDTH) -> Shapes:
    """Return the shapes of the weights of a linear map, by PyTorch's names."""
    return {f"{name}.weight": (outputs, inputs), f"{name}.bias": (outputs,)}


def attention_shapes() -> Shapes:
    """Return the shapes of the weights of all layers of attention and of the last normalisation."""
    table: Shapes = {}
    for layer in range(LAYERS):
        name = f"layers.{layer}"
        table |= _normalised_shapes(f"{name}.before_attention")
        table |= linear_shapes(f"{name}.queries_keys_values", WIDTH, 3 * WIDTH)
        table |= linear_shapes(f"{name}.attended", WIDTH)
        table |= _normalised_shapes(f"{name}.before_inner")
        table |= linear_shapes(f"{name}.inner", WIDTH, INNER)
        table |= linear_shapes(f"{name}.outer", INNER)
    return table | _normalised_shapes("last")


def _normalised_shapes(name: str) -> Shapes:
    return {f"{name}.weight": (WIDTH,), f"{name}.bias": (WIDTH,)}


@dataclass(frozen=True, slots=True)
class AttentionNetwork:
    """Layers of attention with their weights.

    Attributes
    ----------
    weights : dict of str to (outputs, inputs) or (outputs,) float32
        Weights by PyTorch's names.
    """

    weights: Weights
    _transposed: Weights = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        matrices = {name: weight for name, weight in self.weights.items() if weight.ndim == 2}
        transposed = {name: np.ascontiguousarray(weight.T, np.float32) for name, weight in matrices.items()}
        object.__setattr__(self, "_transposed", transposed)

    def mixed(self, tokens: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return tokens (n, WIDTH) that have attended to each other."""
        for layer in range(LAYERS):
            tokens = self._layer(f"layers.{layer}", tokens)
        return self._normalised("last", tokens)

    def linear(self, name: str, inputs: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the linear map of some inputs (n, inputs)."""
        return np.asarray(product(inputs, self._transposed[f"{name}.weight"]) + self.weights[f"{name}.bias"])

    def _layer(self, name: str, tokens: NDArray[np.float32]) -> NDArray[np.float32]:
        tokens = tokens + self._attended(name, self._normalised(f"{name}.before_attention", tokens))
        inner = self.linear(f"{name}.inner", self._normalised(f"{name}.before_inner", tokens))
        return tokens + self.linear(f"{name}.outer", np.maximum(inner, 0.0))

    def _attended(self, name: str, tokens: NDArray[np.float32]) -> NDArray[np.float32]:
        parts = self.linear(f"{name}.queries_keys_values", tokens)
        heads = np.ascontiguousarray(parts.reshape(len(tokens), 3, HEADS, -1).transpose(1, 2, 0, 3))
        mixed = [_mixed_values(queries, keys, values) for queries, keys, values in zip(*heads, strict=True)]
        return self.linear(f"{name}.attended", np.concatenate(mixed, axis=1))

    def _normalised(self, name: str, tokens: NDArray[np.float32]) -> NDArray[np.float32]:
        centred = tokens - tokens.mean(axis=-1, keepdims=True)
        scaled = centred / np.sqrt((centred**2).mean(axis=-1, keepdims=True) + np.float32(EPSILON))
        return np.asarray(scaled * self.weights[f"{name}.weight"] + self.weights[f"{name}.bias"])


def _mixed_values(
    queries: NDArray[np.float32], keys: NDArray[np.float32], values: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Return the values of a head, (n, k), each a mean of all by how alike queries and keys are."""
    alike = product(queries, np.ascontiguousarray(keys.T)) / np.float32(math.sqrt(WIDTH // HEADS))
    shares = np.exp(alike - alike.max(axis=-1, keepdims=True))
    shares /= shares.sum(axis=-1, keepdims=True)
    return np.asarray(product(shares, values))
