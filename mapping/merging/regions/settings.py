"""Settings of regions: where free space is split, and which regions and doors may be the same."""

import math
from dataclasses import dataclass
from typing import Annotated

from lidarium.mapping.geometry.bounds import (
    Angle,
    Count,
    Counted,
    Distance,
    FromZero,
    Length,
    above,
    check_settings,
    share,
    within,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class RegionSettings:
    """How free space is split into regions, and how those of two maps are matched.

    Attributes
    ----------
    cell_m : float
        Side of the cells in which regions are found, or that of the map where it is larger [m].
    most_cells : int
        Maps that know more of such cells are split in larger ones: a bound of time.
    least_obstacle_m : float
        What stands in free space and is smaller along both axes does not split it [m].
    widest_door_m : float
        Widest gap that is a door [m].
    door_share : float
        Largest width of a door as a share of the width of the narrower region.
    least_radius_m : float
        Radius of the disc that a region holds at least [m].
    least_area_m2 : float
        Area of a region at least; smaller ones belong to a neighbour [m2].
    most_regions, most_doors : int
        So many of the largest regions, and of the widest doors, are matched.
    extent_m, extent_share : float
        By how much the extents of one region may differ between maps [m, share]: the larger of both.
    door_width_m : float
        By how much the widths of one door may differ [m].
    scale_share : float
        By how much the ratio of a region's extents may differ where a scale is sought, as a share.
    scale_steps : int
        So many scales to each side of that of two regions are proposed too, 3 % apart.
    candidates : int
        Number of motions that are refined and judged.
    apart_m, apart_angle : float
        These differ by more [m, rad].
    likely_rotations : bool
        Whether of all rotations only those are tried under which the walls of both maps run alike. That takes
        half the time, and misses rivals by which strangers are known.
    """

    cell_m: Length = 0.05
    most_cells: Annotated[int, within(1000, 100_000_000)] = 500_000
    least_obstacle_m: Distance = 0.4
    widest_door_m: Length = 1.5
    door_share: Annotated[float, share()] = 0.75
    least_radius_m: Distance = 0.35
    least_area_m2: FromZero = 1.5
    most_regions: Count = 24
    most_doors: Count = 32
    extent_m: Distance = 0.3
    extent_share: Annotated[float, share()] = 0.08
    door_width_m: Distance = 0.3
    scale_share: Annotated[float, above(0.0, 1.0)] = 0.08
    scale_steps: Counted = 4
    candidates: Annotated[int, within(1, 1000)] = 12
    apart_m: Distance = 0.3
    apart_angle: Angle = math.radians(4.0)
    likely_rotations: bool = False

    def __post_init__(self) -> None:
        check_settings(self, "regions")
