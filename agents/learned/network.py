"""A network that ranks options: attention over options, teammates and the situation, in plain numpy.

Its preference is that of classic tours plus a learned correction, which is zero at the start of a training.

References
----------
A. Vaswani et al., "Attention is all you need", 2017; normalisation before each part: R. Xiong et al., "On
layer normalization in the transformer architecture", 2020.
"""

import math
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lidarium.agents.learned.decision import CROP_SIDE, Decision
from lidarium.agents.learned.features import OPTION_FEATURES, SITUATION_FEATURES, TEAMMATE_FEATURES
from lidarium.mapping.files.weight_files import WeightFiles, Weights
from lidarium.mapping.planning.touring.map_crops import FREE, OCCUPIED

WIDTH, HEADS, LAYERS, INNER, CROP_WIDTH = 64, 4, 2, 128, 48
"""Numbers a token has; heads and layers of attention; inner numbers of a layer, and of a crop."""

EPSILON = 1e-5
"""Added to variances before they divide."""

SHIPPED, CARD = "learned.safetensors", "learned.json"
"""Shipped weights and their card."""


def _shapes() -> dict[str, tuple[int, ...]]:
    """Return the shape of every array of weights, by name; the names are PyTorch's."""
    table: dict[str, tuple[int, ...]] = {}

    def linear(name: str, inputs: int, outputs: int) -> None:
        table[f"{name}.weight"], table[f"{name}.bias"] = (outputs, inputs), (outputs,)

    def normalised(name: str) -> None:
        table[f"{name}.weight"], table[f"{name}.bias"] = (WIDTH,), (WIDTH,)

    linear("option", len(OPTION_FEATURES), WIDTH)
    linear("crop", 2 * CROP_SIDE * CROP_SIDE, CROP_WIDTH)
    linear("crop_out", CROP_WIDTH, WIDTH)
    linear("teammate", len(TEAMMATE_FEATURES), WIDTH)
    linear("situation", len(SITUATION_FEATURES), WIDTH)
    for layer in range(LAYERS):
        normalised(f"layers.{layer}.before_attention")
        linear(f"layers.{layer}.queries_keys_values", WIDTH, 3 * WIDTH)
        linear(f"layers.{layer}.attended", WIDTH, WIDTH)
        normalised(f"layers.{layer}.before_inner")
        linear(f"layers.{layer}.inner", WIDTH, INNER)
        linear(f"layers.{layer}.outer", INNER, WIDTH)
    normalised("last")
    linear("correction", WIDTH, 1)
    table["steepness"] = (1,)
    return table


@dataclass(frozen=True, slots=True)
class Network:
    """A network with its weights."""

    weights: Weights

    def __call__(self, decision: Decision) -> int:
        """Return the option with the greatest preference."""
        preferences = self.preferences(decision)
        return int(np.argmax(np.where(decision.mask, preferences, -np.inf)))

    def preferences(self, decision: Decision) -> NDArray[np.float32]:
        """Return how much each option is preferred, (n,) float32, whatever the mask."""
        tokens = self._tokens(decision)
        for layer in range(LAYERS):
            tokens = self._layer(f"layers.{layer}", tokens)
        options = self._normalised("last", tokens[len(tokens) - len(decision.options) :])
        correction = self._linear("correction", options)[:, 0]
        return np.asarray(self.weights["steepness"] * decision.scores + correction, np.float32)

    def _tokens(self, decision: Decision) -> NDArray[np.float32]:
        """Return the situation, the teammates and the options, a row for each."""
        crops = decision.crops.reshape(len(decision.crops), -1)
        seen = np.concatenate([crops == OCCUPIED, crops == FREE], axis=1).astype(np.float32)
        options = self._linear("option", decision.options)
        options += self._linear("crop_out", np.maximum(self._linear("crop", seen), 0.0))
        teammates = self._linear("teammate", decision.teammates)
        return np.concatenate([self._linear("situation", decision.situation[None]), teammates, options])

    def _layer(self, name: str, tokens: NDArray[np.float32]) -> NDArray[np.float32]:
        tokens = tokens + self._attended(name, self._normalised(f"{name}.before_attention", tokens))
        inner = self._linear(f"{name}.inner", self._normalised(f"{name}.before_inner", tokens))
        return tokens + self._linear(f"{name}.outer", np.maximum(inner, 0.0))

    def _attended(self, name: str, tokens: NDArray[np.float32]) -> NDArray[np.float32]:
        parts = self._linear(f"{name}.queries_keys_values", tokens)
        queries, keys, values = parts.reshape(len(tokens), 3, HEADS, -1).transpose(1, 2, 0, 3)
        alike = queries @ keys.transpose(0, 2, 1) / np.float32(math.sqrt(WIDTH // HEADS))
        shares = np.exp(alike - alike.max(axis=-1, keepdims=True))
        shares /= shares.sum(axis=-1, keepdims=True)
        return self._linear(f"{name}.attended", (shares @ values).transpose(1, 0, 2).reshape(len(tokens), -1))

    def _linear(self, name: str, inputs: NDArray[np.float32]) -> NDArray[np.float32]:
        return np.asarray(inputs @ self.weights[f"{name}.weight"].T + self.weights[f"{name}.bias"])

    def _normalised(self, name: str, tokens: NDArray[np.float32]) -> NDArray[np.float32]:
        centred = tokens - tokens.mean(axis=-1, keepdims=True)
        scaled = centred / np.sqrt((centred**2).mean(axis=-1, keepdims=True) + np.float32(EPSILON))
        return np.asarray(scaled * self.weights[f"{name}.weight"] + self.weights[f"{name}.bias"])


FILES = WeightFiles(_shapes(), "lidarium.agents.learned", SHIPPED, CARD)
"""Files of this network's weights."""

save_weights, _check_weights = FILES.save, FILES.check


def load_weights(path: str | Path = "") -> dict[str, NDArray[np.float32]]:
    """Return the weights of a file; if ``path`` is empty, the package's."""
    return FILES.load(path) if path != "" else dict(_shipped())


@lru_cache(maxsize=1)
def _shipped() -> dict[str, NDArray[np.float32]]:
    return FILES.load()
