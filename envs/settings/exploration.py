"""Every knob of the exploration environments, with its unit and default."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from typing import Annotated, Any, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.settings.battery import BATTERIES, Battery
from lidarium.envs.settings.cameras import CAMERAS as CAMERAS
from lidarium.envs.settings.cameras import DepthCamera
from lidarium.envs.settings.faults import NO_FAULTS, FaultSettings
from lidarium.envs.settings.lidar import LIDARS, Lidar, by_robot, checked_lidars, envelope_of_lidars
from lidarium.envs.settings.limits import OBSERVABLES as OBSERVABLES
from lidarium.envs.settings.limits import check_workload, egocentric_scales_of, observed_names
from lidarium.envs.settings.observables import check_sensed
from lidarium.envs.settings.odometry import ODOMETRY, OdometrySettings
from lidarium.envs.settings.radio import RADIO, RadioSettings
from lidarium.envs.settings.rewards import RewardSettings
from lidarium.envs.settings.robots import ROBOTS, Robot, envelope_of, kinds_of
from lidarium.mapping.geometry.bounds import (
    above,
    check_anything,
    check_settings,
    inner,
    share,
    shown,
    within,
)
from lidarium.mapping.grids.occupancy import OccupancySettings
from lidarium.mapping.localization.registry import LOCALIZERS
from lidarium.mapping.sparse.settings import MODES
from lidarium.registry import REGISTRIES, registry, unknown


@dataclass(frozen=True, slots=True, kw_only=True)
class SparseMapSettings:
    """Parameters of a robot's sparse map, which it makes from the first request on.

    Attributes
    ----------
    codes : int, default 256
        Maximum number of codes of an image, for floor and obstacles together.
    most_boxes : int, default 1500
        A map with more boxes merges them with a larger slack.
    least_motion_m : float, default 0.3
        An image is coded if the robot has moved this far since the last one [m].
    least_turn : float
        An image is coded if the robot has turned this far since the last one [rad].
    cell_m : float, default 0.1
        Side of the cells of seen ground [m].
    margin_m : float, default 0.05
        Minimum distance between body and boxes on paths on the map [m].
    mode : str
        What codes are: boxes (``default``), or points without extent (``thesis``).
    """

    codes: Annotated[int, within(2, 65_536)] = 256
    most_boxes: Annotated[int, within(1, 1_000_000)] = 1500
    least_motion_m: Annotated[float, within(0.0, 1e3)] = 0.3
    least_turn: Annotated[float, within(0.0, 2.0 * math.pi)] = math.radians(25.0)
    cell_m: Annotated[float, above(0.0, 10.0)] = 0.1
    margin_m: Annotated[float, within(0.0, 10.0)] = 0.05
    mode: str = MODES[0]

    def __post_init__(self) -> None:
        check_settings(self, "the sparse map")
        if self.mode not in MODES:
            raise ValueError(f"mode of the sparse map is {self.mode!r}; want one of {', '.join(MODES)}")


@dataclass(frozen=True, slots=True, kw_only=True)
class GraphSettings:
    """The lattice of nodes of the level ``graph``; defaults are those of DARE (Cao et al., ICRA 2025).

    Attributes
    ----------
    spacing : float, default 4.0
        Distance between nodes along each axis [m].
    neighbours : int, default 2
        An edge leads to nodes up to this many spacings away along each axis, if the line between is known to be free.
    utility_share : float, default 0.8
        A node counts the frontiers within this share of the laser's range that are visible from it.
    least_utility : int, default 1
        A node with at most this many frontiers in view counts as having none, from then on.
    frontier_spacing : float, default 1.6
        Side of the squares in each of which one frontier cell is counted [m].
    offers : int, default 400
        Maximum number of nodes that are observed, those with the shortest paths.
    """

    spacing: Annotated[float, above(0.0, 1e3)] = 4.0
    neighbours: Annotated[int, within(1, 8)] = 2
    utility_share: Annotated[float, share()] = 0.8
    least_utility: Annotated[int, within(0, 1_000_000)] = 1
    frontier_spacing: Annotated[float, above(0.0, 1e3)] = 1.6
    offers: Annotated[int, within(1, 4096)] = 400

    def __post_init__(self) -> None:
        check_settings(self, "the graph")


MAX_ROBOTS = 64
MAX_PEOPLE = 1000
MAX_FRONTIERS = 1024
MAX_PYRAMID_LEVELS = 16
MAX_MAP_CELLS = 4096
MAX_EGOCENTRIC_CELLS = 1024

OCCUPANCY = inner(
    resolution=within(0.005, 10.0),
    hit=above(0.0, 127.0),
    miss=above(0.0, 127.0),
    minimum=within(-127.0, 0.0),
    maximum=within(0.0, 127.0),
)
"""Bounds of the maps' settings; their own class only checks that the values fit together."""

TRUE_POSE = "truth"
"""The name for no localization: the robot is given its true pose."""

STARTS = ("fixed", "drawn")
"""Start poses of the robots: those of the floor, or random ones in its largest free area."""

KERNEL_LOCALIZATIONS = (TRUE_POSE, "odometry")
"""Localizations that can run within the kernels of a step.

They are the truth, or the wheels alone.
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class ExplorationSettings:
    """A team on a floor.

    Attributes
    ----------
    robots : int, default 3
        Number of robots, 1 to 64.
    robot : Robot
        The body of each; with ``kinds`` a body with room for all of them and the limits of the slowest, by
        which paths are planned.
    kinds : tuple of str
        Names of the robots of a mixed team, in order, repeated from the first if there are too few; empty
        if all are ``robot``.
    lidar : Lidar
        The laser of each; with ``lidars`` one with the longest range, the widest view and the most noise of them.
    lidars : tuple of Lidar
        The lasers of a team whose lasers differ, in order, repeated from the first if there are too few; empty if all
        are ``lidar``. The numbers of beams and the heights must be equal.
    camera : DepthCamera or None
        The depth camera of each robot; None for no camera.
    occupancy : OccupancySettings
        Their maps.
    sparse_map : SparseMapSettings
        Their sparse maps, which robots with cameras make when asked to.
    reward : RewardSettings
        Weights of the reward.
    known_starts : bool, default True
        Whether the robots know their start poses; otherwise each believes that it starts at (0, 0, 0).
    starts : str or None
        Start poses: ``fixed`` uses the starts of the floor as far as it has any; ``drawn`` draws them from the
        seed. None is ``drawn`` for the functions that make environments and if each episode draws its floor, else
        ``fixed``.
    reveals_starts : bool, default False
        Whether reports include the true starts of robots with unknown starts, as a bound for the results of map
        merging.
    localization : str
        Source of the robot's pose: ``truth`` or the name of a localizer.
    localizer : object or None
        Settings of that localizer, an instance of its class ``Settings``; None for its defaults.
    odometry : OdometrySettings
        Accuracy of the wheels' path measurement.
    radio : RadioSettings
        Radio links between the robots.
    faults : FaultSettings
        Faults of the robots.
    battery : Battery
        Battery of each robot.
    people : int, default 0
        Number of people who walk on the floor.
    doors : float, default 0.0
        Share of the openings between rooms that have doors: sliding doors that open when somebody comes, stand open
        or stay shut.
    pauses_when_blocked : bool, default False
        Whether a robot whose bumper touches anything, or whose path is blocked, pauses until it is ordered to resume.
    backend : str, default "kinematic"
        The world: ``kinematic``, ``bullet`` or another that is registered.
    time_step : float, default 0.1
        Simulated time of a step [s].
    scan_period_s : float or None
        Time from scan to scan, a multiple of ``time_step`` and at most the decision period; maps and score follow
        scans [s]. None scans in each step. Longer ones need true poses or odometry, and no camera.
    horizon_s : float or None, default 600.0
        Simulated time after which the episode is truncated [s]; None for no horizon.
    stop_coverage : float or None, default 0.99
        Share of F at which all robots end as ``covered``; None to disable.
    stop_on_contact : bool, default False
        Whether a robot that touches anything ends as ``collision``.
    goal_radius : float, default 0.3
        Distance to the goal, if the floor has one, at which a robot ends as ``reached`` [m].
    observe : tuple of str
        The observations: any of ``OBSERVABLES``, kept in that order, and of the registry
        ``observable``. Functions that make environments leave out ``pose`` if it is not named.
    map_cells : int, default 256
        Side of the observed ``map`` [cells], a multiple of 2; half of it is the maximum distance of a waypoint
        along each axis.
    egocentric_cells : int, default 64
        Side of each crop of the ``egocentric_map`` [cells of the crop], a multiple of 2.
    egocentric_scales : tuple of int
        Side of a cell of each crop of the ``egocentric_map`` [cells of the map].
    pyramid_cells : int, default 32
        Side of each picture of the ``pyramid`` [cells of the picture], a multiple of 2.
    pyramid_levels : int, default 3
        Number of pictures of the ``pyramid``.
    frontiers : int, default 32
        Maximum number of frontiers that the level of frontiers offers.
    least_frontier : float, default 0.5
        Length of a frontier that is offered [m]; shorter ones are offered only if none of this length exists.
    frontiers_by_size : float, default 0.5
        Share of the frontiers that are offered because they are the longest; the others are those with the cheapest
        paths.
    graph : GraphSettings
        The nodes of the level of nodes.
    state_cells : int, default 32
        Side of the pictures in the true ``state`` of the team [cells].
    raster_resolution : float, default 0.025
        Side of a cell of the world's raster [m]; the maps' cell is a whole multiple of it.
    decision_period_s : float, default 2.0
        Maximum duration of a waypoint or a frontier [s].
    threads : int, default 1
        Threads of the kernels; the result does not depend on it.
    """

    robots: Annotated[int, within(1, MAX_ROBOTS)] = 3
    robot: Robot = field(default_factory=lambda: ROBOTS["kobuki"])
    kinds: tuple[str, ...] = ()
    lidar: Lidar = field(default_factory=lambda: LIDARS["urg"])
    lidars: tuple[Lidar, ...] = ()
    camera: DepthCamera | None = None
    occupancy: Annotated[OccupancySettings, OCCUPANCY] = field(default_factory=OccupancySettings)
    sparse_map: SparseMapSettings = field(default_factory=SparseMapSettings)
    reward: RewardSettings = field(default_factory=RewardSettings)
    known_starts: bool = True
    starts: str | None = None
    reveals_starts: bool = False
    localization: str = TRUE_POSE
    localizer: Annotated[Any, inner(particles=within(1, 20_000))] = None
    odometry: OdometrySettings = ODOMETRY["ideal"]
    radio: RadioSettings = RADIO["all"]
    faults: FaultSettings = NO_FAULTS
    battery: Battery = BATTERIES["none"]
    people: Annotated[int, within(0, MAX_PEOPLE)] = 0
    doors: Annotated[float, share()] = 0.0
    pauses_when_blocked: bool = False
    backend: str = "kinematic"
    time_step: Annotated[float, within(1e-4, 10.0)] = 0.1
    scan_period_s: Annotated[float, above(0.0, 1e6)] | None = None
    horizon_s: Annotated[float, above(0.0, 1e8)] | None = 600.0
    stop_coverage: Annotated[float, share(has_minimum=False)] | None = 0.99
    stop_on_contact: bool = False
    goal_radius: Annotated[float, above(0.0, 1e4)] = 0.3
    observe: tuple[str, ...] = ("scan", "pose", "velocity", "bumper", "map")
    map_cells: Annotated[int, within(2, MAX_MAP_CELLS)] = 256
    egocentric_cells: Annotated[int, within(2, MAX_EGOCENTRIC_CELLS)] = 64
    egocentric_scales: tuple[int, ...] = (1, 4)
    pyramid_cells: Annotated[int, within(2, MAX_EGOCENTRIC_CELLS)] = 32
    pyramid_levels: Annotated[int, within(1, MAX_PYRAMID_LEVELS)] = 3
    frontiers: Annotated[int, within(1, MAX_FRONTIERS)] = 32
    least_frontier: Annotated[float, within(0.0, 1e4)] = 0.5
    frontiers_by_size: Annotated[float, share()] = 0.5
    graph: GraphSettings = field(default_factory=GraphSettings)
    state_cells: Annotated[int, within(1, MAX_EGOCENTRIC_CELLS)] = 32
    raster_resolution: Annotated[float, within(0.005, 10.0)] = 0.025
    decision_period_s: Annotated[float, above(0.0, 1e6)] = 2.0
    threads: Annotated[int, within(1, 1024)] = 1

    def __post_init__(self) -> None:
        for name, wanted in PARTS.items():
            is_absent = getattr(self, name) is None and name in OPTIONAL_PARTS
            if not is_absent and not isinstance(getattr(self, name), wanted):
                raise ValueError(
                    f"{name} is {shown(getattr(self, name))}; want "
                    f"{wanted.__name__}{' or its name' if name in REGISTRIES else ''}"
                    f"{', or None' if name in OPTIONAL_PARTS else ''}"
                )
        check_settings(self)
        object.__setattr__(self, "kinds", kinds_of(self.kinds))
        if self.kinds:
            object.__setattr__(self, "robot", envelope_of(self.team))
        lidars = checked_lidars(self.lidars)
        if lidars:
            object.__setattr__(self, "lidar", envelope_of_lidars(by_robot(lidars, self.robots)))
        object.__setattr__(self, "lidars", lidars if len(set(lidars)) > 1 else ())
        if self.localization not in _localizations():
            raise ValueError(f"localization is {self.localization!r}; want one of {', '.join(_localizations())}")
        if self.starts is not None and self.starts not in STARTS:
            raise ValueError(f"starts is {shown(self.starts)}; want {', '.join(STARTS)} or None")
        if self.localizer is not None:
            self._check_localizer()
        if self.backend != "kinematic" and self.backend not in registry("backend"):
            raise ValueError(f"backend is {self.backend!r}; want one of {', '.join(registry('backend'))}")
        for name in ("map_cells", "egocentric_cells", "pyramid_cells"):
            if getattr(self, name) % 2:
                raise ValueError(f"{name} is {getattr(self, name)}; want an even number")
        # Lists, as files of settings have them, become tuples: settings can be compared and hashed.
        object.__setattr__(self, "observe", observed_names(self.observe))
        object.__setattr__(self, "egocentric_scales", egocentric_scales_of(self.egocentric_scales))
        multiple = self.occupancy.resolution / self.raster_resolution
        if round(multiple) < 1 or abs(multiple - round(multiple)) > 1e-6:
            raise ValueError(
                f"resolution of the maps is {self.occupancy.resolution} m; "
                f"want a whole multiple of raster_resolution {self.raster_resolution} m"
            )
        if not self.time_step <= self.decision_period_s:
            raise ValueError(
                f"decision_period_s is {self.decision_period_s} s; want at least the time step of {self.time_step} s"
            )
        if self.camera is not None:
            self._check_camera(self.camera)
        if self.scan_period_s is not None:
            self._check_scan_period(self.scan_period_s)
        for number, fault in enumerate(self.faults.schedule):
            if fault.robot >= self.robots:
                raise ValueError(
                    f"fault {number} ({fault.kind}) is of robot {fault.robot}, but robots is {self.robots}; "
                    f"want a robot from 0 to {self.robots - 1}"
                )
        check_sensed(self)
        check_workload(self)

    def _check_camera(self, camera: DepthCamera) -> None:
        """Check that the camera is within the body of each robot; elsewhere it could be inside a wall."""
        radius, height = (min(getattr(robot, name) for robot in self.team) for name in ("radius", "height"))
        if math.hypot(camera.forward, camera.left) > radius:
            raise ValueError(
                f"the camera is mounted at forward {camera.forward} m, left {camera.left} m, beyond the "
                f"robot's radius of {radius} m, where a wall may be; want it on the robot"
            )
        if camera.height > height:
            raise ValueError(
                f"height of the camera is {camera.height} m, above the robot's height of "
                f"{height} m, where furniture may be; want at most that, or a higher robot"
            )

    def _check_scan_period(self, period: float) -> None:
        steps = period / self.time_step
        if round(steps) < 1 or abs(steps - round(steps)) > 1e-6:
            raise ValueError(
                f"scan_period_s is {period} s; want a whole multiple of the time step of {self.time_step} s"
            )
        if self.scan_steps == 1:
            return
        if self.camera is not None:
            raise ValueError(
                f"scan_period_s is {period} s, but the robots have a camera, whose images need a scan in each step; "
                "want no camera, or scan_period_s None (realism other than 'fast')"
            )
        if self.localization not in KERNEL_LOCALIZATIONS:
            raise ValueError(
                f"scan_period_s is {period} s, but localizer {self.localization!r} needs a scan in each step; want "
                f"localization {' or '.join(KERNEL_LOCALIZATIONS)}, or scan_period_s None"
            )

    def _check_localizer(self) -> None:
        if self.localization not in LOCALIZERS:
            raise ValueError(f"localizer is given, but localization is {self.localization!r}, which has no settings")
        wanted = LOCALIZERS[self.localization].Settings
        if not isinstance(self.localizer, wanted):
            raise ValueError(
                f"localizer is {shown(self.localizer)}; want {wanted.__name__} for localization {self.localization!r}"
            )
        check_anything(self.localizer, f"localizer {self.localization!r}")

    @property
    def is_ideal(self) -> bool:
        """Whether sensors, poses, radio and robots are perfect."""
        is_plain = self.localization == "truth" and self.odometry.is_ideal and self.radio.is_ideal
        return is_plain and not self.lidar.is_noisy and self.faults == NO_FAULTS

    @property
    def may_fail(self) -> bool:
        """Whether a robot can die, or take itself to be beyond its map."""
        has_forces = self.backend != "kinematic"
        return has_forces or self.localization != "truth" or self.faults != NO_FAULTS

    @property
    def team(self) -> list[Robot]:
        """The body of each robot."""
        if not self.kinds:
            return [self.robot] * self.robots
        return [ROBOTS[self.kinds[k % len(self.kinds)]] for k in range(self.robots)]

    @property
    def team_lidars(self) -> list[Lidar]:
        """The laser of each robot."""
        return by_robot(self.lidars or self.lidar, self.robots)

    @property
    def speed_limits(self) -> NDArray[np.float64]:
        """Greatest speed and turn rate of each robot, (robots, 2) [m/s, rad/s]."""
        return np.array([(robot.max_speed, robot.max_turn_rate) for robot in self.team])

    @property
    def agents(self) -> list[str]:
        """Names of the robots."""
        return [f"robot_{robot}" for robot in range(self.robots)]

    @property
    def horizon_steps(self) -> int | None:
        """Steps until the horizon, or None."""
        return None if self.horizon_s is None else max(round(self.horizon_s / self.time_step), 1)

    @property
    def scan_steps(self) -> int:
        """Steps from scan to scan."""
        return 1 if self.scan_period_s is None else round(self.scan_period_s / self.time_step)

    @property
    def decision_steps(self) -> int:
        """Steps of a decision period."""
        return max(round(self.decision_period_s / self.time_step), 1)


_KINDS = {
    name: (kind, *get_args(kind)) if get_origin(kind) is not tuple else (kind,)
    for name, kind in get_type_hints(ExplorationSettings).items()
}

PARTS: dict[str, type] = {
    name: kind for name, kinds in _KINDS.items() for kind in kinds if isinstance(kind, type) and is_dataclass(kind)
}
"""Settings that are made of others."""

OPTIONAL_PARTS = tuple(name for name in PARTS if type(None) in _KINDS[name])
"""Those that may be None."""


def _localizations() -> tuple[str, ...]:
    """Return the names of all sources of poses."""
    return (TRUE_POSE, *LOCALIZERS)


def localizer_settings(localization: str, values: Mapping[str, Any]) -> Any:  # noqa: ANN401
    """Return the own settings of a localizer."""
    if localization not in LOCALIZERS:
        raise ValueError(f"localization {localization!r} has no settings; choose one of {', '.join(LOCALIZERS)}")
    try:
        return with_parts(LOCALIZERS[localization].Settings, values)
    except (TypeError, ValueError) as error:
        raise ValueError(f"settings of localizer {localization!r} cannot be used: {error}") from error


def with_parts(kind: type, values: Mapping[str, Any]) -> Any:  # noqa: ANN401
    """Make a dataclass from values; those of parts that are dataclasses may be mappings."""
    hints = get_type_hints(kind)
    known = [each.name for each in fields(kind)]
    for name in values:
        if name not in known:
            raise ValueError(f"{kind.__name__}: {unknown('setting', name, known)}")
    made = {
        name: with_parts(hints[name], value) if isinstance(value, Mapping) and is_dataclass(hints.get(name)) else value
        for name, value in values.items()
    }
    return kind(**made)
