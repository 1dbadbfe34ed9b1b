"""How sparse maps are made: all settings of the mapper.

References
----------
Sparse mapper, sections 2, 4 and 15: the values of the thesis, and defaults for those that it omits.
"""

import math
from dataclasses import dataclass, field
from typing import Annotated

from lidarium.mapping.geometry.bounds import above, check_settings, share, within

MODES = ("default", "thesis")
SPLITS = ("height", "normal", "both")


@dataclass(frozen=True, slots=True, kw_only=True)
class FloorSettings:
    """How the floor is found.

    Attributes
    ----------
    up_x, up_y, up_z : float, default 0.0, 0.0, 1.0
        Which way is up in the map, about; of any length.
    most_tilt : float
        By how much the floor may lean from there [rad].
    distance_m : float, default 0.03
        How far a point of the floor may be from its plane [m].
    least_share : float, default 0.03
        Share of the points that has to lie on the floor.
    most_below : float, default 0.03
        Share of the points that may lie below the floor: a table top is none.
    trials : int, default 600
        Planes that are tried.
    """

    up_x: Annotated[float, within(-1e3, 1e3)] = 0.0
    up_y: Annotated[float, within(-1e3, 1e3)] = 0.0
    up_z: Annotated[float, within(-1e3, 1e3)] = 1.0
    most_tilt: Annotated[float, above(0.0, math.pi / 2.0)] = math.radians(15.0)
    distance_m: Annotated[float, above(0.0, 1.0)] = 0.03
    least_share: Annotated[float, share()] = 0.03
    most_below: Annotated[float, share()] = 0.03
    trials: Annotated[int, within(1, 100_000)] = 600

    def __post_init__(self) -> None:
        check_settings(self, "the floor")
        if not math.hypot(self.up_x, self.up_y, self.up_z) > 0.0:
            raise ValueError("up of the floor is 0, 0, 0; want a direction")


@dataclass(frozen=True, slots=True, kw_only=True)
class MapperSettings:
    """How a map is made of points.

    Attributes
    ----------
    mode : str
        ``default``, or ``thesis`` for codes as points, split by the height of their centroids.
    split : str, default "height"
        Points of the floor: points below ``floor_height_m``, points of level surfaces, or points that
        are ``both``.
    floor_height_m : float, default 0.1
        Height above the floor's plane up to which points belong to it [m].
    most_slope : float
        Angle by which a level surface may lean [rad].
    robot_height_m, ceiling_margin_m : float, default 1.2, 0.3
        Points higher than their sum above the floor are ignored [m].
    noise_depth_m : float, default 0.1
        Points deeper below the floor are ignored [m].
    range_m : float or None
        Points farther from the sensor are left out [m]; None for none.
    voxel_m : float, default 0.02
        Side of the voxels whose means are coded [m]; 0 codes all points.
    floor_share : float, default 0.3
        Share of the codes that goes to the floor.
    merges : bool, default True
        Whether boxes that are mostly empty are cut, and boxes merged. Codes that are to be registered are
        not: a merged one says less of its surface.
    slack_m : float, default 0.02
        Boxes merge if their union adds nothing that is farther from them than this [m].
    most_boxes : int, default 1500
        A map with more boxes merges with a larger slack.
    merge_radius_m : float, default 0.25
        Free codes nearer to each other than this are merged [m].
    least_motion_m, least_turn : float
        A frame is taken if the robot has moved or turned by so much since the last one [m, rad].
    seed : int, default 0
        Of all random draws.
    floor_gap_m : float, default 0.1
        How far from points of the floor it counts as seen between them [m]: holes wider than twice this stay holes.
        0 for a map that does not know what of its floor was seen.
    fits_boxes : bool, default True
        Whether boxes are compared with all points, if they merge: those that are mostly empty are divided.
    floor : FloorSettings
        How the floor is found.
    """

    mode: str = "default"
    split: str = "height"
    floor_height_m: Annotated[float, within(0.0, 10.0)] = 0.10
    most_slope: Annotated[float, above(0.0, math.pi / 2.0)] = math.radians(30.0)
    robot_height_m: Annotated[float, above(0.0, 100.0)] = 1.2
    ceiling_margin_m: Annotated[float, within(0.0, 100.0)] = 0.3
    noise_depth_m: Annotated[float, within(0.0, 100.0)] = 0.10
    range_m: Annotated[float, above(0.0, 1e4)] | None = None
    voxel_m: Annotated[float, within(0.0, 1.0)] = 0.02
    floor_share: Annotated[float, share(has_minimum=False, has_maximum=False)] = 0.3
    merges: bool = True
    slack_m: Annotated[float, within(0.0, 1.0)] = 0.02
    most_boxes: Annotated[int, within(1, 1_000_000)] = 1500
    merge_radius_m: Annotated[float, within(0.0, 10.0)] = 0.25
    least_motion_m: Annotated[float, within(0.0, 1e3)] = 0.5
    least_turn: Annotated[float, within(0.0, 2.0 * math.pi)] = math.radians(45.0)
    seed: Annotated[int, within(0, 2**32 - 1)] = 0
    fits_boxes: bool = True
    floor_gap_m: Annotated[float, within(0.0, 1.0)] = 0.10
    floor: FloorSettings = field(default_factory=FloorSettings)

    def __post_init__(self) -> None:
        check_settings(self, "the mapper")
        for name, among in (("mode", MODES), ("split", SPLITS)):
            if getattr(self, name) not in among:
                raise ValueError(f"{name} of the mapper is {getattr(self, name)!r}; want one of {', '.join(among)}")

    @property
    def ceiling_m(self) -> float:
        """Height above the floor from which points are left out [m]."""
        return self.robot_height_m + self.ceiling_margin_m
