"""A network that ranks options: attention over options, teammates and the situation, in plain numpy.

Its preference is that of classic tours plus a learned correction, which is zero at the start of a training.
"""

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lidarium.agents.attention import WIDTH, AttentionNetwork, attention_shapes, linear_shapes
from lidarium.agents.learned.decision import CROP_SIDE, Decision
from lidarium.agents.learned.features import OPTION_FEATURES, SITUATION_FEATURES, TEAMMATE_FEATURES
from lidarium.mapping.files.weight_files import WeightFiles, Weights
from lidarium.mapping.planning.touring.map_crops import FREE, OCCUPIED

CROP_WIDTH = 48
"""Inner numbers of a crop."""

SHIPPED, CARD = "learned.safetensors.xz", "learned.json"
"""Shipped weights and their card."""


def _shapes() -> dict[str, tuple[int, ...]]:
    """Return the shape of every array of weights, by name; the names are PyTorch's."""
    return {
        **linear_shapes("option", len(OPTION_FEATURES)),
        **linear_shapes("crop", 2 * CROP_SIDE * CROP_SIDE, CROP_WIDTH),
        **linear_shapes("crop_out", CROP_WIDTH),
        **linear_shapes("teammate", len(TEAMMATE_FEATURES)),
        **linear_shapes("situation", len(SITUATION_FEATURES)),
        **attention_shapes(),
        **linear_shapes("correction", WIDTH, 1),
        "steepness": (1,),
    }


@dataclass(frozen=True, slots=True)
class Network(AttentionNetwork):
    """A network with its weights."""

    def __call__(self, decision: Decision) -> int:
        """Return the option with the greatest preference."""
        preferences = self.preferences(decision)
        return int(np.argmax(np.where(decision.mask, preferences, -np.inf)))

    def preferences(self, decision: Decision) -> NDArray[np.float32]:
        """Return how much each option is preferred, (n,) float32, whatever the mask."""
        tokens = self.mixed(self._tokens(decision))
        correction = self.linear("correction", tokens[len(tokens) - len(decision.options) :])[:, 0]
        return np.asarray(self.weights["steepness"] * decision.scores + correction, np.float32)

    def _tokens(self, decision: Decision) -> NDArray[np.float32]:
        """Return the situation, the teammates and the options, a row for each."""
        crops = decision.crops.reshape(len(decision.crops), -1)
        seen = np.concatenate([crops == OCCUPIED, crops == FREE], axis=1).astype(np.float32)
        options = self.linear("option", decision.options)
        options += self.linear("crop_out", np.maximum(self.linear("crop", seen), 0.0))
        teammates = self.linear("teammate", decision.teammates)
        return np.concatenate([self.linear("situation", decision.situation[None]), teammates, options])


FILES = WeightFiles(_shapes(), "lidarium.agents.learned", SHIPPED, CARD)
"""Files of this network's weights."""

PREDICTOR, NO_PREDICTOR = "predictor", "nothing"
"""Note of a file of weights: the predictor of the maps on which they were trained, by default none."""


def save_weights(path: Path, weights: Weights, predictor: str = NO_PREDICTOR) -> str:
    """Write weights that were trained on maps of a predictor, and return the SHA-256 of the file."""
    return FILES.save(path, weights, None if predictor == NO_PREDICTOR else {PREDICTOR: predictor})


def predictor_of(path: str | Path = "") -> str:
    """Return the predictor of the maps on which the weights of a file were trained."""
    notes = FILES.notes(path) if path != "" else _shipped()[1]
    return notes.get(PREDICTOR, NO_PREDICTOR)


def load_weights(path: str | Path = "") -> dict[str, NDArray[np.float32]]:
    """Return the weights of a file; if ``path`` is empty, the package's."""
    return FILES.load(path) if path != "" else dict(_shipped()[0])


@lru_cache(maxsize=1)
def _shipped() -> tuple[dict[str, NDArray[np.float32]], dict[str, str]]:
    return FILES.load(), FILES.notes()
