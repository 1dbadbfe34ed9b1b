"""Whole cells and quarter turns by which maps that share their cells lie on each other exactly."""

import math

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.grids.occupancy import OCCUPIED, UNKNOWN
from lidarium.mapping.merging.description.described_map import DescribedMap
from lidarium.mapping.merging.wall_alignment import wall_sample

NEARLY = math.radians(1.5)
"""By how much a rotation may miss a quarter turn that is exact [rad]."""

REACH_CELLS = 6
"""By how many cells a translation may miss the exact one."""

SAME = 0.9
"""Share of the walls that meet occupied cells of the other map: only copies of cells do so."""

SAMPLES = 2000


def exact_motion(a: DescribedMap, b: DescribedMap, a_from_b: Transform) -> Transform | None:
    """Return the motion by whole cells and quarter turns near another one, if the maps share cells.

    Parameters
    ----------
    a, b : DescribedMap
        Maps of one resolution.
    a_from_b : Transform
        The motion that was found.

    Returns
    -------
    Transform or None
        The exact one; None where the maps do not share their cells.
    """
    quarters = round(a_from_b.theta / (0.5 * math.pi))
    if abs(a_from_b.theta - quarters * 0.5 * math.pi) > NEARLY or len(b.walls) == 0:
        return None
    cosine, sine = ((1, 0), (0, 1), (-1, 0), (0, -1))[quarters % 4]
    turn = np.array([[cosine, -sine], [sine, cosine]], np.int64)
    cells = np.floor(b.walls / b.resolution).astype(np.int64)
    middle = b.walls.mean(axis=0)
    # Corners of cells turn into corners: a cell is named by its centre's.
    turned = (np.floor((cells + 0.5) @ turn.T)).astype(np.int64)
    start = np.rint((a_from_b.apply(middle) - turn @ middle) / a.resolution).astype(np.int64)
    few = turned[wall_sample(len(turned), SAMPLES)]
    reach = np.arange(-REACH_CELLS, REACH_CELLS + 1)
    steps = start + np.stack(np.meshgrid(reach, reach), axis=-1).reshape(-1, 2)
    best = steps[int(np.argmax([_same(a.levels, few + step)[0] for step in steps]))]
    hits, share = _same(a.levels, turned + best)
    if share < SAME or hits == 0:
        return None
    x, y = (best * a.resolution).tolist()
    return Transform(x, y, math.remainder(quarters * 0.5 * math.pi, 2.0 * math.pi))


def _same(levels: NDArray[np.uint8], cells: NDArray[np.int64]) -> tuple[int, float]:
    """Return how many cells (n, 2) meet occupied ones, and their share of those that meet known ones."""
    rows, columns = levels.shape
    x, y = cells.T
    is_inside = (x >= 0) & (x < columns) & (y >= 0) & (y < rows)
    found = levels[y[is_inside], x[is_inside]]
    hits, known = int((found == OCCUPIED).sum()), int((found != UNKNOWN).sum())
    return hits, hits / max(known, 1)
