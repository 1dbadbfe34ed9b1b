"""Variants of plans: of another size, turned, and with boxes in the rooms, as furniture and clutter stand there."""

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from lidarium.envs.floors.catalogue.names import load_floor
from lidarium.envs.floors.floor import Floor

CELL_M = 0.025
"""Side of a cell of the drawing [m]: walls stay closed when they are turned."""

SCALES, TURNED_SHARE = (0.85, 1.2), 0.4
"""Range of the factor that scales a plan, and the share of the plans that are turned by any angle."""

BOXES_M2, BOX_M, AT_WALL_SHARE, AT_WALL_M = 0.2, (0.15, 1.2), 0.7, 0.5
"""Maximum number of boxes per m2, range of their sides [m], share of boxes near walls, and how near [m]."""

LEFT_SHARE = 0.8
"""Minimum share of the free area that has to stay connected; otherwise no boxes are put in."""

LASER_M = 0.3
"""Plans are cut at this height [m]."""


def draw_plan(plans: Sequence[str], seed: Sequence[int], bare_share: float) -> Floor:
    """Return a variant of the plan of ``plan_number``."""
    plan, generator = plans[plan_number(plans, seed)], np.random.default_rng([*seed, 1])
    solid = load_floor(plan).raster(CELL_M, LASER_M, LASER_M).solid.astype(np.uint8)
    if generator.random() < TURNED_SHARE:
        solid = _turned(solid, float(generator.uniform(0.0, 90.0)))
    scale = float(generator.uniform(*SCALES))
    if generator.random() >= bare_share:
        solid = _furnished(solid, scale * CELL_M, generator)
    floor = load_floor(np.where(solid != 0, np.uint8(0), np.uint8(255)), scale * CELL_M)
    return replace(floor, name=f"variant {'-'.join(map(str, seed))} of {plan}")


def plan_number(plans: Sequence[str], seed: Sequence[int]) -> int:
    """Return which of some plans a seed draws."""
    return int(np.random.default_rng(seed).integers(len(plans)))


def _turned(solid: NDArray[np.uint8], degrees: float) -> NDArray[np.uint8]:
    """Rotate a plan about its middle; the new corners are solid."""
    rows, columns = solid.shape
    turn = cv2.getRotationMatrix2D(((columns - 1) / 2.0, (rows - 1) / 2.0), degrees, 1.0)
    cosine, sine = abs(turn[0, 0]), abs(turn[0, 1])
    wide, high = int(np.ceil(rows * sine + columns * cosine)), int(np.ceil(rows * cosine + columns * sine))
    turn[:, 2] += (wide - columns) / 2.0, (high - rows) / 2.0
    return np.asarray(
        cv2.warpAffine(
            solid, turn, (wide, high), flags=cv2.INTER_NEAREST, borderMode=cv2.BORDER_CONSTANT, borderValue=1
        )
    )


def _furnished(solid: NDArray[np.uint8], cell: float, generator: np.random.Generator) -> NDArray[np.uint8]:
    """Put boxes into the free area, unless they part it."""
    distances = cv2.distanceTransform(1 - solid, cv2.DIST_L2, 3) * cell
    free, near = np.argwhere(distances > 0.0), np.argwhere((distances > 0.0) & (distances < AT_WALL_M))
    count = int(generator.uniform(0.0, BOXES_M2) * len(free) * cell**2)
    filled = solid.copy()
    for _ in range(count):
        places = near if generator.random() < AT_WALL_SHARE else free
        middle = places[int(generator.integers(len(places)))]
        low = np.maximum(np.round(middle - generator.uniform(*BOX_M, 2) / (2.0 * cell)).astype(np.int64), 0)
        high = 2 * middle - low + 1
        filled[low[0] : high[0], low[1] : high[1]] = 1
    return filled if _largest(filled) >= LEFT_SHARE * ((filled == 0).sum()) else solid


def _largest(solid: NDArray[np.uint8]) -> int:
    """Return the number of cells of the largest free area."""
    areas = cv2.connectedComponentsWithStats((solid == 0).astype(np.uint8), connectivity=4)[2]
    return int(areas[1:, cv2.CC_STAT_AREA].max(initial=0))
