"""Descriptors of a map around its corners.

Samples on rings form arrays of radius by angle, which a rotation of the map merely shifts.

Column 0 points where the corner opens to, so that descriptors of one corner in two maps differ by the error
of that angle alone.
"""

import math
from dataclasses import dataclass, field
from typing import Annotated, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.bounds import Length, check_settings, within
from lidarium.mapping.grids.occupancy import FREE, OCCUPIED
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.merging.corners import Corners

VARIANTS = ("two_rings", "polar", "log_polar")
MAX_RINGS = 1000
"""Rings of a band at most."""

Worth = Annotated[float, within(-1e6, 1e6)]


@dataclass(frozen=True, slots=True, kw_only=True)
class DescriptorSettings:
    """Samples of a descriptor.

    Attributes
    ----------
    variant : str
        ``polar``: rings at equal distances; ``log_polar``: rings at equal ratios; ``two_rings``: two bands of
        rings, the far one of a smoothed map, which see beyond the corner itself.
    radius_min, radius_max : float, default 0.1, 0.6
        First radius and end of the radii [m].
    radius_step : float, default 0.1
        Distance of rings [m]; for ``log_polar`` it gives their number alone.
    far_min, far_max, far_step : float, default 0.6, 2.6, 0.2
        The same of the far band of ``two_rings`` [m].
    columns : int, default 64
        Samples around the corner.
    occupied, unknown, free : float, default 1.0, 0.0, -0.25
        Value of a sample of each type of cell.
    """

    variant: str = "two_rings"
    radius_min: Length = 0.1
    radius_max: Length = 0.6
    radius_step: Length = 0.1
    far_min: Length = 0.6
    far_max: Length = 2.6
    far_step: Length = 0.2
    columns: Annotated[int, within(8, 4096)] = 64
    occupied: Worth = 1.0
    unknown: Worth = 0.0
    free: Worth = -0.25

    def __post_init__(self) -> None:
        check_settings(self, "descriptors")
        if self.variant not in VARIANTS:
            raise ValueError(f"variant of descriptors is {self.variant!r}; want one of {', '.join(VARIANTS)}")
        bands = [
            ("radius", self.radius_min, self.radius_max, self.radius_step),
            ("far", self.far_min, self.far_max, self.far_step),
        ]
        for name, low, high, step in bands:
            if not (low < high and step <= high - low <= MAX_RINGS * step):
                raise ValueError(
                    f"{name}_min, _max and _step are {low}, {high} and {step} m; want 0 < min < max, 0 < "
                    f"step <= max - min and at most {MAX_RINGS} rings"
                )


class Descriptors(NamedTuple):
    """Descriptors of the corners of a map.

    Attributes
    ----------
    values : (n, rings, columns) float32
        Samples.
    known : (n, rings, columns) float32
        Share of each sample that is known.
    """

    values: NDArray[np.float32]
    known: NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class _Band:
    """Rings that are sampled from one smoothed map."""

    radii: NDArray[np.float64]
    smoothing: int = field(default=1)


def describe_corners(
    levels: NDArray[np.uint8], resolution: float, corners: Corners, settings: DescriptorSettings | None = None
) -> Descriptors:
    """Sample a map around its corners.

    Parameters
    ----------
    levels : (rows, columns) uint8
        The three-level map.
    resolution : float
        Side of a cell [m].
    corners : Corners
        Where.
    settings : DescriptorSettings or None
        Samples.
    """
    settings = settings or DescriptorSettings()
    bands = _bands(resolution, settings)
    rings = sum(len(band.radii) for band in bands)
    values = np.zeros((len(corners), rings, settings.columns), np.float32)
    known = np.zeros_like(values)
    occupied, free = _mask_of(levels, OCCUPIED), _mask_of(levels, FREE)
    positions = corners.cells + 0.5
    first = 0
    for band in bands:
        solid, open_ = _smoothed(occupied, band.smoothing), _smoothed(free, band.smoothing)
        last = first + len(band.radii)
        worth = np.array([settings.occupied, settings.unknown, settings.free])
        _sample(
            solid,
            open_,
            positions,
            corners.angles,
            band.radii,
            worth,
            values[:, first:last],
            known[:, first:last],
        )
        first = last
    return Descriptors(values, known)


def _bands(resolution: float, settings: DescriptorSettings) -> list[_Band]:
    near = np.arange(settings.radius_min, settings.radius_max - 1e-9, settings.radius_step)
    if settings.variant == "polar":
        return [_Band(near / resolution)]
    if settings.variant == "log_polar":
        return [_Band(np.geomspace(settings.radius_min, settings.radius_max, len(near)) / resolution)]
    # Samples stand for the cells between them: the map is smoothed over the distance of rings.
    far = np.arange(settings.far_min, settings.far_max - 1e-9, settings.far_step)
    return [
        _Band(near / resolution, _odd(settings.radius_step / resolution)),
        _Band(far / resolution, _odd(settings.far_step / resolution)),
    ]


def _odd(cells: float) -> int:
    return 2 * int(cells / 2.0) + 1


def _mask_of(levels: NDArray[np.uint8], level: int) -> NDArray[np.uint8]:
    return np.asarray((levels == level) * np.uint8(255), np.uint8)


def _smoothed(mask: NDArray[np.uint8], cells: int) -> NDArray[np.uint8]:
    return mask if cells <= 1 else np.asarray(cv2.blur(mask, (cells, cells), borderType=cv2.BORDER_CONSTANT), np.uint8)


@kernel
def _sample(
    occupied: Array,
    free: Array,
    places: Array,
    angles: Array,
    radii: Array,
    worth: Array,
    values: Array,
    known: Array,
) -> None:
    """Fill ``values`` and ``known`` at the nearest cell of each sample.

    From its shares of occupied and free cells [of 255].
    """
    rows, columns = occupied.shape
    samples = values.shape[2]
    for column in range(samples):
        for i in range(places.shape[0]):
            angle = angles[i] + 2.0 * math.pi * column / samples
            cosine, sine = math.cos(angle), math.sin(angle)
            for ring in range(radii.shape[0]):
                x = int(math.floor(places[i, 0] + radii[ring] * cosine))
                y = int(math.floor(places[i, 1] + radii[ring] * sine))
                solid, open_ = 0.0, 0.0
                if 0 <= x < columns and 0 <= y < rows:
                    solid, open_ = occupied[y, x] / 255.0, free[y, x] / 255.0
                values[i, ring, column] = solid * worth[0] + (1.0 - solid - open_) * worth[1] + open_ * worth[2]
                known[i, ring, column] = solid + open_
