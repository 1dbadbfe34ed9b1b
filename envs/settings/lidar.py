"""Planar laser range finders, with the noise of their ranges."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any

from lidarium.mapping.geometry.bounds import Distance, above, check_settings, shown, within
from lidarium.mapping.grids.scan_geometry import MAX_BEAMS, ScanGeometry
from lidarium.registry import Registry

MOST_RANGE_M = 200.0
"""Farthest that a simulated laser may reach [m]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Lidar(ScanGeometry):
    """A planar laser range finder at the centre of the robot.

    Attributes
    ----------
    noise_floor : float, default 0.0
        Minimum standard deviation of the range noise [m].
    noise_share : float, default 0.0
        Standard deviation of the range noise as a share of the range, above ``noise_floor`` [1].
    height : float, default 0.3
        Height of the laser's plane above the floor [m].
    """

    # The first four are those of a scan, here with the bounds of the simulation.
    beams: Annotated[int, within(1, MAX_BEAMS)] = 727
    field_of_view: Annotated[float, above(0.0, 2.0 * math.pi + 1e-9)] = math.radians(240.0)
    range_min: Distance = 0.02
    range_max: Annotated[float, above(0.0, MOST_RANGE_M)] = 5.6
    noise_floor: Annotated[float, within(0.0, 100.0)] = 0.0
    noise_share: Annotated[float, within(0.0, 10.0)] = 0.0
    height: Annotated[float, above(0.0, 100.0)] = 0.3

    def __post_init__(self) -> None:
        check_settings(self, "the laser")
        ScanGeometry.__post_init__(self)

    @property
    def is_noisy(self) -> bool:
        """Whether ranges carry noise."""
        return self.noise_floor > 0.0 or self.noise_share > 0.0


LIDARS: Registry[Lidar] = Registry("lidar")
"""Lasers by name."""

LIDARS.register("urg", Lidar(), "URG-04LX-UG01 as simulated in the theses: 240 degrees, 4 m")
LIDARS.register(
    "lidar_360_6m",
    Lidar(beams=180, field_of_view=2.0 * math.pi, range_max=6.0),
    "180 beams all around, 6 m",
)
LIDARS.register(
    "lidar_360_20m",
    Lidar(beams=720, field_of_view=2.0 * math.pi, range_min=0.1, range_max=20.0),
    "720 beams all around, 20 m",
)

NOISE: Registry[tuple[float, float]] = Registry("noise")
"""Range noise by name: floor [m] and share of the range of its standard deviation."""

NOISE.register("none", (0.0, 0.0), "exact ranges")
NOISE.register("datasheet", (0.01, 0.01), "0.01 m or 1 % of the range, the larger, as in the data sheet")
NOISE.register("thesis", (0.03, 0.0), "0.03 m, as in the theses")


def by_robot(lidar: Lidar | Sequence[Lidar], robots: int) -> list[Lidar]:
    """Return the laser of each robot: those of a sequence in order, from the front again if these are too few."""
    lidars = [lidar] if isinstance(lidar, Lidar) else lidar
    return [lidars[k % len(lidars)] for k in range(robots)]


def checked_lidars(lidars: Any) -> tuple[Lidar, ...]:  # noqa: ANN401
    """Return the lasers of a team as a tuple, checked."""
    wanted = f"want Lidar or its name ({', '.join(LIDARS)}) for each robot, in a list"
    if not isinstance(lidars, list | tuple):
        raise ValueError(f"lidars is {shown(lidars)}; {wanted}")
    for each in lidars:
        if not isinstance(each, Lidar):
            raise ValueError(f"lidars has {shown(each)}; {wanted}")
    for name in ("beams", "height"):
        values = [getattr(each, name) for each in lidars]
        if len(set(values)) > 1:
            raise ValueError(
                f"{name} of the lidars is {shown(values)}; want the same for all robots of a team: their lidars may "
                "differ in field_of_view, range_min, range_max, noise_floor and noise_share"
            )
    return tuple(lidars)


def envelope_of_lidars(lidars: Sequence[Lidar]) -> Lidar:
    """Return a laser with the longest range, the widest view and the most noise of a team's."""
    largest = ("field_of_view", "range_max", "noise_floor", "noise_share")
    bounds = {name: max(getattr(each, name) for each in lidars) for name in largest}
    return replace(lidars[0], range_min=min(each.range_min for each in lidars), **bounds)
