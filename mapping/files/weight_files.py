"""Files of networks' weights: safetensors of named float32 arrays, and those that the package has, with their cards."""

import hashlib
import json
import lzma
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.numpy import load, save

from lidarium.mapping.files.guarded_reading import read_bytes, reason
from lidarium.mapping.files.output import write_whole
from lidarium.mapping.geometry.bounds import shown

MAX_BYTES = 5_000_000
"""Files of weights are no larger."""

Weights = Mapping[str, NDArray[np.float32]]


@dataclass(frozen=True, slots=True)
class WeightFiles:
    """The files of one kind of network.

    Attributes
    ----------
    shapes : dict
        Shape of every array by name.
    package : str
        The package whose folder ``data`` has the weights that are shipped.
    shipped, card : str
        Names of their file, compressed by ``xz``, and of its card, which has the SHA-256 of its content.
    is_half : bool
        Whether files hold half precision, which takes half the space.
    """

    shapes: Mapping[str, tuple[int, ...]]
    package: str
    shipped: str
    card: str
    is_half: bool = False

    def load(self, path: str | Path = "") -> dict[str, NDArray[np.float32]]:
        """Return the weights of a file; if ``path`` is empty, the package's."""
        return self.read(self._content(path), str(path) or self.shipped)

    def notes(self, path: str | Path = "") -> dict[str, str]:
        """Return the metadata of a file of weights, which is checked as by ``load``."""
        content = self._content(path)
        self.read(content, str(path) or self.shipped)
        header = json.loads(content[8 : 8 + int.from_bytes(content[:8], "little")])  # the format of safetensors
        return dict(header.get("__metadata__", {}))

    def _content(self, path: str | Path) -> bytes:
        if not isinstance(path, str | Path):
            raise ValueError(f"weights is {shown(path)}; want the name of a file")
        return read_bytes(Path(path), MAX_BYTES) if str(path) else self._shipped_content()

    def read(self, content: bytes, name: str) -> dict[str, NDArray[np.float32]]:
        """Return the weights of a file's content; ``name`` is its name in messages."""
        try:
            weights: dict[str, NDArray[Any]] = load(content)
        except (SafetensorError, ValueError, KeyError, TypeError) as error:
            raise ValueError(f"{name} is no file of weights, or is truncated: {error}") from error
        if self.is_half:
            halves = {key: array for key, array in weights.items() if array.dtype == np.float16}
            weights |= {key: array.astype(np.float32) for key, array in halves.items()}
        self.check(weights, name)
        return weights

    def save(self, path: Path, weights: Weights, notes: dict[str, str] | None = None) -> str:
        """Write weights to a file, whole or not at all, and return its SHA-256."""
        self.check(weights, "what was trained")
        kind = np.float16 if self.is_half else np.float32
        content = save({name: np.ascontiguousarray(array, kind) for name, array in weights.items()}, notes)
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, content)
        return hashlib.sha256(content).hexdigest()

    def check(self, weights: Weights, name: str) -> None:
        """Check that weights are those of this network."""
        for key in sorted({*weights, *self.shapes}):
            if key not in weights or key not in self.shapes:
                what = "lacks" if key not in weights else "has"
                raise ValueError(f"{name} {what} the array {key!r}; it is of another network or version")
            array = weights[key]
            if array.shape != self.shapes[key] or array.dtype != np.float32:
                raise ValueError(
                    f"{name} holds {key!r} as {array.dtype} {array.shape}; want float32 {self.shapes[key]}: "
                    "it is of another network or version"
                )
            if not np.isfinite(array).all():
                raise ValueError(f"{name} holds {key!r} with numbers that are not finite; train again")

    def _shipped_content(self) -> bytes:
        """Return the file of the package's weights, checked against the hash that its card names."""
        folder = resources.files(self.package) / "data"
        try:
            content = lzma.decompress((folder / self.shipped).read_bytes())
            wanted = json.loads((folder / self.card).read_text(encoding="utf-8"))["sha256"]
        except (OSError, lzma.LZMAError, ValueError, LookupError, TypeError) as error:
            raise ValueError(
                f"{self.shipped} of the package or its card {self.card} cannot be read ({reason(error)}); install "
                "the package again, or name a file of weights: weights=FILE"
            ) from error
        if hashlib.sha256(content).hexdigest() != wanted:
            raise ValueError(f"{self.shipped} is not what its card {self.card} names; install the package again")
        return content
