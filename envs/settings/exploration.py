"""Every knob of the exploration environments, with its unit and default."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, is_dataclass
from numbers import Integral
from typing import Any, get_type_hints

from lidarium.envs.settings.battery import BATTERIES, Battery
from lidarium.envs.settings.faults import NO_FAULTS, FaultSettings
from lidarium.envs.settings.lidar import LIDARS, Lidar
from lidarium.envs.settings.odometry import ODOMETRY, OdometrySettings
from lidarium.envs.settings.radio import RADIO, RadioSettings
from lidarium.envs.settings.rewards import RewardSettings
from lidarium.envs.settings.robots import ROBOTS, Robot
from lidarium.mapping.grids.occupancy import OccupancySettings
from lidarium.mapping.localization.registry import LOCALIZERS
from lidarium.registry import REGISTRIES, registry, unknown

MAX_ROBOTS = 64
MAX_MAP_CELLS = 4096
MAX_EGOCENTRIC_CELLS = 1024
MAX_EGOCENTRIC_SCALE = 64

OBSERVABLES = ("scan", "pose", "velocity", "bumper", "map", "egocentric_map")
"""What a robot can observe, in the order in which observations have it.

A goal is observed wherever the floor has one.
"""

TRUE_POSE = "truth"
"""The localization that is none: the robot is given its true pose."""

KERNEL_LOCALIZATIONS = (TRUE_POSE, "odometry")
"""Localizations that can run within the kernels of a step.

They are the truth, or the wheels alone.
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class ExplorationSettings:
    """A team on a floor.

    Attributes
    ----------
    robots : int
        Number of robots, 1 to 64.
    robot : Robot
        The body of each.
    lidar : Lidar
        The laser of each.
    occupancy : OccupancySettings
        Their maps.
    reward : RewardSettings
        Weights of the reward.
    known_starts : bool
        Whether the robots know where they start; otherwise each believes to start at (0, 0, 0).
    reveals_starts : bool
        Whether reports tell where robots with unknown starts truly started, as a bound for what merging maps
        can reach.
    localization : str
        Who says where the robot is: ``truth`` or the name of a localizer.
    localizer : object or None
        Own settings of that localizer, of its class ``Settings``; None for its defaults.
    odometry : OdometrySettings
        How well wheels tell the way.
    radio : RadioSettings
        How robots reach each other.
    faults : FaultSettings
        What goes wrong with them.
    battery : Battery
        What energy each has.
    pauses_when_blocked : bool
        Whether a robot whose bumper touches anything, or whose way is blocked, pauses until it is told to
        resume.
    backend : str
        The world: ``kinematic``.
    time_step : float
        Simulated time of a step [s].
    horizon_s : float or None
        Simulated time after which the episode is truncated [s]; None for no horizon.
    stop_coverage : float or None
        Share of F at which all robots end as ``covered``; None for off.
    stop_on_contact : bool
        Whether a robot that touches anything ends as ``collision``.
    goal_radius : float
        Distance to the goal, where the floor has one, at which a robot ends as ``reached`` [m].
    observe : tuple of str
        What the robots observe, any of ``OBSERVABLES``; given in any order, kept in that of ``OBSERVABLES``.
    map_cells : int
        Side of the observed ``map`` [cells], a multiple of 2; half of it is how far a waypoint of the level
        of waypoints can lie.
    egocentric_cells : int
        Side of each crop of the ``egocentric_map`` [cells of the crop], a multiple of 2.
    egocentric_scales : tuple of int
        Side of a cell of each crop of the ``egocentric_map`` [cells of the map].
    raster_resolution : float
        Side of a cell of the world's raster [m]; the maps' cell is a whole multiple of it.
    decision_period_s : float
        How long a waypoint or a frontier holds [s].
    threads : int
        Threads of the kernels; the result does not depend on it.
    """

    robots: int = 3
    robot: Robot = field(default_factory=lambda: ROBOTS["kobuki"])
    lidar: Lidar = field(default_factory=lambda: LIDARS["urg"])
    occupancy: OccupancySettings = field(default_factory=OccupancySettings)
    reward: RewardSettings = field(default_factory=RewardSettings)
    known_starts: bool = True
    reveals_starts: bool = False
    localization: str = TRUE_POSE
    localizer: Any = None
    odometry: OdometrySettings = ODOMETRY["ideal"]
    radio: RadioSettings = RADIO["all"]
    faults: FaultSettings = NO_FAULTS
    battery: Battery = BATTERIES["none"]
    pauses_when_blocked: bool = False
    backend: str = "kinematic"
    time_step: float = 0.1
    horizon_s: float | None = 600.0
    stop_coverage: float | None = 0.99
    stop_on_contact: bool = False
    goal_radius: float = 0.3
    observe: tuple[str, ...] = ("scan", "pose", "velocity", "bumper", "map")
    map_cells: int = 256
    egocentric_cells: int = 64
    egocentric_scales: tuple[int, ...] = (1, 4)
    raster_resolution: float = 0.025
    decision_period_s: float = 2.0
    threads: int = 1

    def __post_init__(self) -> None:
        for name, kind in (
            ("robots", Integral),
            ("map_cells", Integral),
            ("egocentric_cells", Integral),
            ("threads", Integral),
        ):
            if isinstance(getattr(self, name), bool) or not isinstance(getattr(self, name), kind):
                raise ValueError(
                    f"{name} is {getattr(self, name)!r}; want a whole "
                    f"number{' from 1 to 64' if name == 'robots' else ''}"
                )
        for name, wanted in PARTS.items():
            if not isinstance(getattr(self, name), wanted):
                raise ValueError(
                    f"{name} is {getattr(self, name)!r}; want "
                    f"{wanted.__name__}{' or its name' if name in REGISTRIES else ''}"
                )
        if not 1 <= self.robots <= MAX_ROBOTS:
            raise ValueError(f"robots is {self.robots}; a team has 1 to {MAX_ROBOTS}")
        if not (math.isfinite(self.goal_radius) and self.goal_radius > 0.0):
            raise ValueError(f"goal_radius is {self.goal_radius} m; want more than 0")
        if self.localization not in localizations():
            raise ValueError(
                f"localization is {self.localization!r}; want one of {', '.join(localizations())}"
            )
        if self.localizer is not None:
            self._check_localizer()
        if self.backend != "kinematic" and self.backend not in registry("backend"):
            raise ValueError(f"backend is {self.backend!r}; want one of {', '.join(registry('backend'))}")
        if not (math.isfinite(self.time_step) and self.time_step > 0.0):
            raise ValueError(f"time_step is {self.time_step} s; want more than 0")
        if self.horizon_s is not None and not 0.0 < self.horizon_s < math.inf:
            raise ValueError(f"horizon_s is {self.horizon_s}; want more than 0 s, or None for no horizon")
        if self.stop_coverage is not None and not 0.0 < self.stop_coverage <= 1.0:
            raise ValueError(
                f"stop_coverage is {self.stop_coverage}; want a share in (0, 1], or None for off"
            )
        if not 2 <= self.map_cells <= MAX_MAP_CELLS or self.map_cells % 2:
            raise ValueError(f"map_cells is {self.map_cells}; want an even number from 2 to {MAX_MAP_CELLS}")
        if not 2 <= self.egocentric_cells <= MAX_EGOCENTRIC_CELLS or self.egocentric_cells % 2:
            raise ValueError(
                f"egocentric_cells is {self.egocentric_cells}; want an even number from 2 to "
                f"{MAX_EGOCENTRIC_CELLS}"
            )
        # Lists, as files of settings have them, become tuples: settings can be compared and hashed.
        object.__setattr__(self, "observe", _observed(self.observe))
        object.__setattr__(self, "egocentric_scales", _scales(self.egocentric_scales))
        if not (math.isfinite(self.raster_resolution) and self.raster_resolution > 0.0):
            raise ValueError(f"raster_resolution is {self.raster_resolution} m; want more than 0")
        multiple = self.occupancy.resolution / self.raster_resolution
        if round(multiple) < 1 or abs(multiple - round(multiple)) > 1e-6:
            raise ValueError(
                f"resolution of the maps is {self.occupancy.resolution} m; "
                f"want a whole multiple of raster_resolution {self.raster_resolution} m"
            )
        if not self.time_step <= self.decision_period_s < math.inf:
            raise ValueError(
                f"decision_period_s is {self.decision_period_s} s; want at least the time step of "
                f"{self.time_step} s"
            )
        if self.threads < 1:
            raise ValueError(f"threads is {self.threads}; want at least 1")

    def _check_localizer(self) -> None:
        if self.localization not in LOCALIZERS:
            raise ValueError(
                f"localizer is given, but localization is {self.localization!r}, which has no settings"
            )
        wanted = LOCALIZERS[self.localization].Settings
        if not isinstance(self.localizer, wanted):
            raise ValueError(
                f"localizer is {self.localizer!r}; want {wanted.__name__} for localization "
                f"{self.localization!r}"
            )

    @property
    def is_ideal(self) -> bool:
        """Whether sensors, poses, radio and robots are perfect."""
        is_plain = self.localization == "truth" and self.odometry.is_ideal and self.radio.is_ideal
        return is_plain and not self.lidar.is_noisy and self.faults == NO_FAULTS

    @property
    def may_fail(self) -> bool:
        """Whether a robot can die, or take itself to be beyond its map."""
        return self.localization != "truth" or self.faults != NO_FAULTS

    @property
    def agents(self) -> list[str]:
        """Names of the robots."""
        return [f"robot_{robot}" for robot in range(self.robots)]

    @property
    def horizon_steps(self) -> int | None:
        """Steps until the horizon, or None."""
        return None if self.horizon_s is None else max(round(self.horizon_s / self.time_step), 1)

    @property
    def decision_steps(self) -> int:
        """Steps of a decision period."""
        return max(round(self.decision_period_s / self.time_step), 1)


PARTS: dict[str, type] = {
    name: kind
    for name, kind in get_type_hints(ExplorationSettings).items()
    if isinstance(kind, type) and is_dataclass(kind)
}
"""Settings that are made of others."""


def localizations() -> tuple[str, ...]:
    """Return the names of all who can say where a robot is."""
    return (TRUE_POSE, *LOCALIZERS)


def localizer_settings(localization: str, values: Mapping[str, Any]) -> Any:  # noqa: ANN401
    """Return the own settings of a localizer.

    Raises
    ------
    ValueError
        Where the localization has no settings, or not these.
    """
    if localization not in LOCALIZERS:
        raise ValueError(
            f"localization {localization!r} has no settings; choose one of {', '.join(LOCALIZERS)}"
        )
    try:
        return with_parts(LOCALIZERS[localization].Settings, values)
    except TypeError as error:
        raise ValueError(f"settings of localizer {localization!r} cannot be used: {error}") from error


def with_parts(kind: type, values: Mapping[str, Any]) -> Any:  # noqa: ANN401
    """Make a dataclass from values; those of parts that are dataclasses may be mappings."""
    hints = get_type_hints(kind)
    made = {
        name: with_parts(hints[name], value)
        if isinstance(value, Mapping) and is_dataclass(hints.get(name))
        else value
        for name, value in values.items()
    }
    return kind(**made)


def _observed(names: Iterable[str]) -> tuple[str, ...]:
    """Return names of what is observed in the order of ``OBSERVABLES``, checked."""
    wanted = f"want one or more of {', '.join(OBSERVABLES)}"
    if isinstance(names, str) or not isinstance(names, Iterable):
        raise ValueError(f"observe is {names!r}; {wanted}, in a list or tuple")
    names = tuple(names)
    for name in names:
        if name not in OBSERVABLES:
            raise ValueError(f"observe has an {unknown('name', name, OBSERVABLES)}")
        if names.count(name) > 1:
            raise ValueError(f"observe is {names}; want {name!r} once")
    if not names:
        raise ValueError(f"observe is empty ({names}); {wanted}")
    return tuple(name for name in OBSERVABLES if name in names)


def _scales(scales: Iterable[int]) -> tuple[int, ...]:
    """Return the scales of the egocentric map as a tuple, checked."""
    wanted = f"want one or more whole numbers from 1 to {MAX_EGOCENTRIC_SCALE}, in a list or tuple"
    if isinstance(scales, str) or not isinstance(scales, Iterable):
        raise ValueError(f"egocentric_scales is {scales!r}; {wanted}")
    scales = tuple(scales)
    for scale in scales:
        if (
            isinstance(scale, bool)
            or not isinstance(scale, Integral)
            or not 1 <= scale <= MAX_EGOCENTRIC_SCALE
        ):
            raise ValueError(f"egocentric_scales is {scales}; {wanted}")
    if not scales:
        raise ValueError(f"egocentric_scales is empty ({scales}); {wanted}")
    return tuple(int(scale) for scale in scales)
