"""Clouds of points."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray


@dataclass(frozen=True, slots=True, eq=False)
class PointCloud:
    """Points in space, with what is known of each.

    Attributes
    ----------
    points : (N, 3) float32
        Coordinates [m].
    weights : (N,) float32 or None
        How many points each stands for; None where each stands for itself.
    normals : (N, 3) float32 or None
        Unit vectors across the surface.
    source : str
        Where they come from, for messages: the name of a file.
    """

    points: NDArray[np.float32]
    weights: NDArray[np.float32] | None = None
    normals: NDArray[np.float32] | None = None
    source: str = "points"

    def __post_init__(self) -> None:
        count = len(self.points)
        wanted = (("points", (count, 3)), ("weights", (count,)), ("normals", (count, 3)))
        for name, shape in wanted:
            value = getattr(self, name)
            if value is None:
                continue
            array = np.ascontiguousarray(value, np.float32)
            if array.shape != shape:
                raise ValueError(f"{name} of {self.source} have shape {array.shape}; want {shape}")
            object.__setattr__(self, name, array)

    def __len__(self) -> int:
        return len(self.points)

    def chosen(self, which: ArrayLike) -> "PointCloud":
        """Return the cloud of some points, (N,) bool or their places."""
        places = np.asarray(which)
        return PointCloud(
            self.points[places],
            None if self.weights is None else self.weights[places],
            None if self.normals is None else self.normals[places],
            self.source,
        )
