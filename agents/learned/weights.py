"""Weights of networks in files: written whole, and checked before they are used. No pickle is loaded."""

import hashlib
import json
from functools import lru_cache
from importlib import resources
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.numpy import load, save

from lidarium.agents.learned.network import Weights, check_weights
from lidarium.mapping.files.guarded_reading import read_bytes, reason
from lidarium.mapping.files.output import write_whole
from lidarium.mapping.geometry.bounds import shown

MOST_BYTES = 5_000_000
"""Files of weights are no larger."""

SHIPPED, CARD = "learned.safetensors", "learned.json"
"""The weights that the package has, and what is said of them."""


def load_weights(path: str | Path = "") -> dict[str, NDArray[np.float32]]:
    """Return the weights of a file; where ``path`` is empty, the package's.

    Raises
    ------
    ValueError
        Where ``path`` is no name; where the file is truncated, larger than 5 MB, or of another network; where
        the package's weights are missing, or not what their card names.
    OSError
        Where it cannot be read.
    """
    if not isinstance(path, str | Path):
        raise ValueError(f"weights is {shown(path)}; want the name of a file")
    if not str(path):
        return dict(_shipped())
    return weights_from(read_bytes(Path(path), MOST_BYTES), str(path))


def weights_from(content: bytes, name: str) -> dict[str, NDArray[np.float32]]:
    """Return the weights of a file's content; ``name`` is what messages call it.

    Raises
    ------
    ValueError
        Where it is truncated, or of another network.
    """
    try:
        weights: dict[str, NDArray[np.float32]] = load(content)
    except (SafetensorError, ValueError, KeyError, TypeError) as error:
        raise ValueError(f"{name} is no file of weights, or is truncated: {error}") from error
    check_weights(weights, name)
    return weights


def save_weights(path: Path, weights: Weights) -> str:
    """Write weights to a file, whole or not at all, and return its SHA-256.

    Raises
    ------
    ValueError
        Where they are not of this network.
    OSError
        Where it cannot be written.
    """
    check_weights(weights, "what was trained")
    content = save({name: np.ascontiguousarray(array) for name, array in weights.items()})
    path.parent.mkdir(parents=True, exist_ok=True)
    write_whole(path, content)
    return hashlib.sha256(content).hexdigest()


@lru_cache(maxsize=1)
def _shipped() -> dict[str, NDArray[np.float32]]:
    """Return the package's weights, checked against the hash that their card names."""
    folder = resources.files("lidarium.agents.learned") / "data"
    try:
        content = (folder / SHIPPED).read_bytes()
        wanted = json.loads((folder / CARD).read_text(encoding="utf-8"))["sha256"]
    except (OSError, ValueError, LookupError, TypeError) as error:
        raise ValueError(
            f"{SHIPPED} of the package or its card {CARD} cannot be read ({reason(error)}); install the "
            "package again, or name a file of weights: weights=FILE"
        ) from error
    if hashlib.sha256(content).hexdigest() != wanted:
        raise ValueError(f"{SHIPPED} is not what its card {CARD} names; install the package again")
    return weights_from(content, SHIPPED)
