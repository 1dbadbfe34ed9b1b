"""Search of all scales at which one map may lie on another.

Walls of most buildings run in two directions, so that four rotations are left, and some beside them where
maps are bent. For each of these, and for each scale on a fine ladder, walls and regions of free space are
correlated at all translations.
"""

import math
from dataclasses import dataclass, field, replace
from typing import Annotated, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.bounds import Angle, Count, Counted, above, check_settings, share, within
from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.merging.correlation import CorrelationSettings, best_translations
from lidarium.mapping.merging.description.described_map import DescribedMap
from lidarium.mapping.merging.description.resampling import resampled

AXIS_STEP = math.radians(0.5)
"""Between the directions of walls that are tried [rad]."""

MOST_WALLS = 4000
"""About so many wall cells show the direction of walls."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ScaleSettings:
    """How a scale is sought.

    Attributes
    ----------
    least, most : float
        By how much the second map may have to grow.
    step : float
        Between the logarithms of neighbouring scales.
    slants : int
        How many rotations to each side of those that bring walls onto the directions of walls are tried.
    slant : float
        Between these [rad].
    correlation : CorrelationSettings
        How coarsely all translations are tried at each.
    apart_m : float
        Translations of one scale and rotation are at least so far apart [m].
    candidates : int
        How many of the best placements are examined.
    rounds : int
        How often the scale of each is refined by the bend that is left.
    cell_m : float
        Side of the cells in which they are, or that of the coarser map where it is larger [m].
    confidence : float
        Confidence from which maps are joined: with another freedom, strangers agree by chance more often.
    """

    least: Annotated[float, within(0.05, 1.0)] = 0.5
    most: Annotated[float, within(1.0, 20.0)] = 2.0
    step: Annotated[float, above(0.001, 0.5)] = 0.03
    slants: Counted = 1
    slant: Angle = math.radians(3.0)
    correlation: CorrelationSettings = field(default_factory=lambda: CorrelationSettings(cell_m=0.2))
    apart_m: Annotated[float, above(0.0, 100.0)] = 1.0
    candidates: Count = 32
    rounds: Count = 3
    cell_m: Annotated[float, within(1e-3, 1.0)] = 0.05
    confidence: Annotated[float, share()] = 0.98

    def __post_init__(self) -> None:
        check_settings(self, "the scale")

    @property
    def scales(self) -> NDArray[np.float64]:
        """All scales that are tried, (n,)."""
        count = math.floor((math.log(self.most) - math.log(self.least)) / self.step + 1e-9) + 1
        return np.asarray(self.least * np.exp(self.step * np.arange(count)))


class Placement(NamedTuple):
    """How the second map may lie on the first.

    Attributes
    ----------
    scale : float
        By how much it grows about its lower left corner.
    a_from_b : Transform
        From the grown map into the first.
    value_m : float
        Walls that agree less those that do not, as far as the map has grown [m].
    """

    scale: float
    a_from_b: Transform
    value_m: float


def wall_axis(described: DescribedMap) -> float:
    """Return the direction of a map's walls, from 0 to a quarter turn [rad].

    It is that across which walls fall into the fewest bins of a histogram: the sum of the squared counts,
    over both axes, is greatest.
    """
    walls = described.walls[:: max(len(described.walls) // MOST_WALLS, 1)]
    if len(walls) == 0:
        return 0.0
    angles = np.arange(0.0, math.pi / 2.0, AXIS_STEP)
    sharpness = [_sharpness(walls, angle, 2.0 * described.resolution) for angle in angles.tolist()]
    return float(angles[int(np.argmax(sharpness))])


def _sharpness(walls: NDArray[np.float64], angle: float, bin_m: float) -> float:
    """Return the sum of squared counts of walls (n, 2) in bins along two axes."""
    turned = Transform(0.0, 0.0, -angle).apply(walls) / bin_m
    bins = np.floor(turned - turned.min(axis=0)).astype(np.int64)
    return float(sum((np.bincount(bins[:, axis]).astype(np.float64) ** 2).sum() for axis in (0, 1)))


def placements(a: DescribedMap, b: DescribedMap, settings: ScaleSettings) -> list[Placement]:
    """Return the placements of map b for which most speaks, the best first.

    They are ranked by the walls that agree, between what these measure in the one map and in the other: in
    metres of the first, small maps would never win, in metres of the second they would fit anywhere.

    Parameters
    ----------
    a, b : DescribedMap
        Maps of one resolution, as drawn.
    settings : ScaleSettings
        How.
    """
    slants = np.arange(-settings.slants, settings.slants + 1) * settings.slant
    quarters = np.arange(4) * (math.pi / 2.0)
    rotations = (wall_axis(a) - wall_axis(b) + quarters[:, None] + slants).ravel()
    found = []
    for scale in settings.scales.tolist():
        grown = replace(b, resolution=b.resolution * scale, walls=b.walls * scale)
        transforms, values = best_translations(a, grown, rotations, settings.correlation, settings.apart_m)
        found += [
            Placement(scale, Transform(*transform), value)
            for transform, value in zip(transforms.tolist(), values.tolist(), strict=True)
        ]
    return sorted(found, key=lambda one: -one.value_m / math.sqrt(one.scale))[: settings.candidates]


def grown_levels(levels: NDArray[np.uint8], resolution: float, wanted: float) -> NDArray[np.uint8]:
    """Return a three-level map in cells of another side, from the same corner.

    Parameters
    ----------
    levels : (rows, columns) uint8
        The map.
    resolution, wanted : float
        Side of its cells, and of those that are returned [m].
    """
    if resolution <= wanted:
        return resampled(levels, resolution, wanted)
    rows, columns = (max(round(side * resolution / wanted), 1) for side in levels.shape)
    return np.asarray(cv2.resize(levels, (columns, rows), interpolation=cv2.INTER_NEAREST), np.uint8)
