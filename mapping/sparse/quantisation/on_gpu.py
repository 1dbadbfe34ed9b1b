"""Lloyd's steps on a GPU through torch, where there is one.

Distances are rounded as on the processor, and of equal codes the one of the lowest number is nearest, so that
labels are the same; sums are made in another order, so that codes may differ in their last bit.
"""

import importlib
from functools import cache
from typing import Any

import numpy as np

from lidarium.mapping.sparse.quantisation.lloyd import Codes, means_of
from lidarium.mapping.sparse.quantisation.tiles import Tiles

MOST_DISTANCES = 1 << 26
"""Distances that are held at once."""


@cache
def has_gpu() -> bool:
    """Whether torch is installed and finds a GPU."""
    try:
        torch = importlib.import_module("torch")
    except ImportError:
        return False
    return bool(torch.cuda.is_available())


def improved_on_gpu(
    tiles: Tiles, codes: Codes, steps: int, keeps_empty: bool = False, device: str = "cuda"
) -> Codes:
    """Return codes after some of Lloyd's steps, as ``improved``, on a device of torch."""
    torch: Any = importlib.import_module("torch")
    points = torch.from_numpy(np.ascontiguousarray(tiles.points.transpose(0, 2, 1)).reshape(-1, 3)).to(device)
    masses = torch.from_numpy(tiles.weights.reshape(-1, 1)).to(device).double()
    weighted = torch.cat([points.double() * masses, masses], 1)
    for _ in range(steps):
        labels = nearest_on(torch, points, torch.from_numpy(codes).to(device))
        sums = torch.zeros((len(codes), 4), dtype=torch.float64, device=device)
        sums.index_add_(0, labels, weighted)
        codes = means_of(tiles, codes, sums.cpu().numpy(), keeps_empty)
    return codes


def nearest_on(torch: Any, points: Any, codes: Any) -> Any:  # noqa: ANN401
    """Return the number of the nearest code of every point."""
    numbers = torch.arange(len(codes), device=points.device)
    found = []
    for some in points.split(max(1, MOST_DISTANCES // len(codes))):
        across = [some[:, axis, None] - codes[None, :, axis] for axis in range(3)]
        x, y, z = (each * each for each in across)
        squares = x + y + z
        is_nearest = squares == squares.min(1, keepdim=True).values
        found.append(torch.where(is_nearest, numbers, len(codes)).min(1).values)
    return torch.cat(found)
