"""Maps of a group bent to agree: each onto those before it.

The first stays as it is. If walls do not hold a map on the others, if it would have to be moved or
stretched more than maps of one place are, or if it then agrees less, it is laid rigidly.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.grids.occupancy import UNKNOWN
from lidarium.mapping.merging.agreement import Agreement
from lidarium.mapping.merging.bend.estimation import Bend, BendSettings, OffsetField, estimate_bend
from lidarium.mapping.merging.bend.hypotheses import MAX_STRAIN, Hypothesis, compare_bent
from lidarium.mapping.merging.described_map import DescribedMap, describe_map
from lidarium.mapping.merging.fusion import FusedMap, fuse


@dataclass(frozen=True, slots=True, eq=False)
class Deformed:
    """Result of bending the maps of a group.

    Attributes
    ----------
    fused : FusedMap
        Their map, in the frame of the first.
    deformations : list of Deformation or None
        How each map is bent; None if it is laid as it was joined.
    laid : list of Laid
        Each map as it is laid.
    """

    fused: FusedMap
    deformations: "list[Deformation | None]"
    laid: "list[Laid]"

    def places(self, number: int, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return points (n, 2) of a map, from its lower left corner, in the common frame [m]."""
        deformation = self.deformations[number]
        if deformation is None:
            return np.asarray(self.laid[number].common_from_cells.apply(points))
        return deformation.places(points)


@dataclass(frozen=True, slots=True, eq=False)
class Deformation:
    """How a map is bent against those before it.

    Attributes
    ----------
    bend : Bend
        In the cells of their fused map.
    moves : (n, 2) float64
        Distance of its walls from their joined positions [m].
    agreement : Agreement
        Agreement with the maps before it once it is bent.
    common_from_under : Transform
        Lower left corner of their fused map in the common frame.
    """

    bend: Bend
    moves: NDArray[np.float64]
    agreement: Agreement
    common_from_under: Transform

    def places(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return points (n, 2) of the bent map in the common frame [m]."""
        return np.asarray(self.common_from_under.apply(self.bend.field.bent(self.bend.a_from_b, points)))

    @property
    def mean_m(self) -> float:
        """Root mean square of the moves [m]."""
        return float(np.sqrt((self.moves**2).sum(axis=1).mean()))

    @property
    def most_m(self) -> float:
        """Longest of the moves [m]."""
        return float(np.hypot(*self.moves.T).max())


@dataclass(frozen=True, slots=True, eq=False)
class Laid:
    """A map in cells of the common frame.

    Attributes
    ----------
    levels : (rows, columns) uint8
        Its known cells.
    common_from_cells : Transform
        Lower left corner of its cell (0, 0).
    """

    levels: NDArray[np.uint8]
    common_from_cells: Transform


def deform(
    maps: Sequence[DescribedMap],
    common_from_map: Sequence[Transform],
    settings: BendSettings,
) -> Deformed:
    """Bend maps that were joined until they agree."""
    resolution = maps[0].resolution
    laid = [Laid(maps[0].levels, common_from_map[0])]
    found: list[Deformation | None] = [None]
    for one, transform in zip(maps[1:], common_from_map[1:], strict=True):
        known = _fused(laid, resolution)
        under = describe_map(known.levels, resolution)
        corner = Transform(*known.origin)
        deformation = _held(under, one, (corner, transform), settings)
        found.append(deformation)
        laid.append(Laid(one.levels, transform) if deformation is None else _bent_map(one, deformation.bend, corner))
    return Deformed(_fused(laid, resolution), found, laid)


def _bent_map(one: DescribedMap, bend: Bend, corner: Transform) -> Laid:
    """Return a bent map in cells along the axes of the map onto which it is bent."""
    side = one.resolution
    rows, columns = np.nonzero(one.levels != UNKNOWN)
    sides = (columns.min(), columns.max() + 1), (rows.min(), rows.max() + 1)
    outline = np.array([(x, y) for x in sides[0] for y in sides[1]])
    margin = float(np.abs(bend.field.offsets).max(initial=0.0)) + side
    box = bend.a_from_b.apply(outline * side)
    low = np.floor((box.min(axis=0) - margin) / side).astype(np.int64)
    high = np.ceil((box.max(axis=0) + margin) / side).astype(np.int64)
    shape = int(high[1] - low[1]), int(high[0] - low[0])
    levels = np.full(shape, UNKNOWN, np.uint8)
    x = (low[0] + np.arange(shape[1]) + 0.5) * side
    for row in range(shape[0]):
        places = np.column_stack([x, np.full(shape[1], (low[1] + row + 0.5) * side)])
        cells = np.floor(bend.field.unbent(bend.a_from_b, places) / side).astype(np.int64)
        inside = ((cells >= 0) & (cells < one.levels.shape[::-1])).all(axis=1)
        levels[row, inside] = one.levels[cells[inside, 1], cells[inside, 0]]
    return Laid(levels, corner @ Transform(float(low[0] * side), float(low[1] * side), 0.0))


def _fused(laid: Sequence[Laid], resolution: float) -> FusedMap:
    return fuse([one.levels for one in laid], [one.common_from_cells for one in laid], resolution)


def _held(
    a: DescribedMap, b: DescribedMap, frames: tuple[Transform, Transform], settings: BendSettings
) -> Deformation | None:
    """Return how map b is bent against map a, None if it is better laid rigidly.

    The frames are those of both maps in the common one.
    """
    if len(a.walls) == 0 or len(b.walls) == 0:
        return None
    a_from_b = frames[0].inverse() @ frames[1]
    bend = estimate_bend(a, b, a_from_b, settings)
    moves = bend.field.bent(bend.a_from_b, b.walls) - a_from_b.apply(b.walls)
    found = Deformation(bend, moves, compare_bent(a, b, bend), frames[0])
    if not bend.is_held or bend.strain > MAX_STRAIN or found.most_m > settings.reach_m:
        return None
    rigid = replace(
        bend,
        a_from_b=a_from_b,
        field=OffsetField(bend.field.corner, bend.field.spacing_m, 0.0 * bend.field.offsets),
    )
    evidence_m = Hypothesis(bend, found.agreement).evidence_m
    return found if evidence_m > Hypothesis(rigid, compare_bent(a, b, rigid)).evidence_m else None
