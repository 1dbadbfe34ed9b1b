"""How robots make sparse maps by their depth cameras."""

import math
from dataclasses import dataclass
from typing import Annotated

from lidarium.mapping.geometry.bounds import above, check_settings, within


@dataclass(frozen=True, slots=True, kw_only=True)
class SparseMapSettings:
    """How a robot makes its sparse map; it does from when the map is first asked for.

    Attributes
    ----------
    codes : int
        Codes of an image, at most, of floor and obstacles together.
    most_boxes : int
        A map with more boxes merges them with a larger slack.
    least_motion_m, least_turn : float
        An image is coded where the robot has moved or turned by so much since the last one [m, rad].
    cell_m : float
        Side of the cells of seen ground [m].
    margin_m : float
        Paths on the map keep the body so far from boxes [m].
    """

    codes: Annotated[int, within(2, 65_536)] = 256
    most_boxes: Annotated[int, within(1, 1_000_000)] = 1500
    least_motion_m: Annotated[float, within(0.0, 1e3)] = 0.3
    least_turn: Annotated[float, within(0.0, 2.0 * math.pi)] = math.radians(25.0)
    cell_m: Annotated[float, above(0.0, 10.0)] = 0.1
    margin_m: Annotated[float, within(0.0, 10.0)] = 0.05

    def __post_init__(self) -> None:
        check_settings(self, "the sparse map")
