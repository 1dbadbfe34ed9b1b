"""Limits beyond single bounds: the observations available, and the cost of a step.

Without the latter a step of settings that are each within their bounds would take all memory, or hours.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from numbers import Integral
from typing import Any

from lidarium.mapping.geometry.bounds import shown
from lidarium.registry import registry, unknown

MAX_EGOCENTRIC_SCALE = 64
MAX_SCALES = 16

OBSERVABLES = ("scan", "pose", "velocity", "bumper", "map", "egocentric_map")
"""Observations that are available to any robot, in their order.

A goal is observed if the floor has one. Measurements of further sensors are in the registry ``observable``.
"""

LEARNERS_SEE = ("scan", "velocity", "bumper", "map")
"""Default observations of the makers of environments.

The absolute pose is left out, because policies may learn floors by heart with it.
"""

GAINS = "frontier_gains"
"""Area expected to be newly seen at each frontier on offer."""

LEVEL_OBSERVABLES = ("frontiers", "action_mask", GAINS)
"""Observations at the level of frontiers only; the first two are always included."""

MOST_SCAN_CELLS = 16_384
MOST_BEAMS = 262_144
MOST_DRIVE = 2e9
MOST_PIECES = 200_000
MOST_OBSERVED = 1 << 28
MOST_STEPS = 1e12
MOST_DECISION = 100_000


@dataclass(frozen=True, slots=True)
class _Product:
    """A product of settings, and how large it may be.

    Attributes
    ----------
    what : str
        Meaning of the product.
    of : callable
        The product, from the settings.
    most : float
        Maximum of the product.
    cure : str
        Which settings to change, and how.
    """

    what: str
    of: Callable[[Any], float]
    most: float
    cure: str


def _pieces(settings: Any) -> float:  # noqa: ANN401
    """Pieces of a quarter of a cell that a robot can drive in a step."""
    return float(settings.speed_limits[:, 0].max() * settings.time_step / settings.raster_resolution) * 4.0 + 1.0


def _drive(settings: Any) -> float:  # noqa: ANN401
    """Cells that bodies are compared with in a step."""
    side = 2.0 * settings.robot.radius / settings.raster_resolution + 3.0
    return float(settings.robots * _pieces(settings) * side * side)


def _observed(settings: Any) -> float:  # noqa: ANN401
    crops = len(settings.egocentric_scales) * settings.egocentric_cells**2
    pixels = 0 if settings.camera is None else settings.camera.rows * settings.camera.columns
    return float(settings.robots * (settings.map_cells**2 + crops + 4 * pixels))


PRODUCTS = (
    _Product(
        "the path that a scan covers in cells of the maps, lidar.range_max / occupancy.resolution,",
        lambda settings: settings.lidar.range_max / settings.occupancy.resolution,
        MOST_SCAN_CELLS,
        "a shorter range or coarser maps",
    ),
    _Product(
        "the number of beams of the team, robots * lidar.beams,",
        lambda settings: settings.robots * settings.lidar.beams,
        MOST_BEAMS,
        "fewer robots or beams",
    ),
    _Product(
        "the number of pieces that a way is driven in, robot.max_speed * time_step / raster_resolution,",
        _pieces,
        MOST_PIECES,
        "a lower max_speed, a shorter time_step or a coarser raster_resolution",
    ),
    _Product(
        "the number of cells that bodies meet in a step, from robots, robot.radius and robot.max_speed,",
        _drive,
        MOST_DRIVE,
        "smaller, slower or fewer robots, or a coarser raster_resolution",
    ),
    _Product(
        "the size of what is observed, robots * (map_cells^2 + scales * egocentric_cells^2 + 4 * pixels),",
        _observed,
        MOST_OBSERVED,
        "fewer map_cells, egocentric_cells or pixels",
    ),
    _Product(
        "the number of steps of an episode, horizon_s / time_step,",
        lambda settings: (settings.horizon_s or 0.0) / settings.time_step,
        MOST_STEPS,
        "a shorter horizon_s, or None for none",
    ),
    _Product(
        "the number of steps of a decision, decision_period_s / time_step,",
        lambda settings: settings.decision_period_s / settings.time_step,
        MOST_DECISION,
        "a shorter decision_period_s",
    ),
)
"""Limits of the cost of a step."""


def check_workload(settings: Any) -> None:  # noqa: ANN401
    """Check that no step of these settings takes more memory or time than there is."""
    for product in PRODUCTS:
        found = product.of(settings)
        if found > product.most:
            raise ValueError(f"{product.what} is {found:,.0f}; want at most {product.most:,.0f}: choose {product.cure}")


def observed_names(names: Iterable[str]) -> tuple[str, ...]:
    """Return checked names of observations, in the order of ``OBSERVABLES``, the registry, the level."""
    known = (*OBSERVABLES, *registry("observable"), *LEVEL_OBSERVABLES)
    wanted = f"want one or more of {', '.join(known)}"
    if isinstance(names, str) or not isinstance(names, Iterable):
        raise ValueError(f"observe is {shown(names)}; {wanted}, in a list or tuple")
    names = tuple(names)
    for name in names:
        if name not in known:
            raise ValueError(f"observe has an {unknown('name', name, known)}")
        if names.count(name) > 1:
            raise ValueError(f"observe is {names}; want {name!r} once")
    if not names:
        raise ValueError(f"observe is empty ({names}); {wanted}")
    return tuple(name for name in known if name in names)


def check_level(names: Iterable[str], level: str) -> None:
    """Check that the observations exist at an action level."""
    absent = [name for name in names if name in LEVEL_OBSERVABLES]
    if absent and level != "frontier":
        raise ValueError(f"observe has {absent[0]!r}, which needs level='frontier'; level is {level!r}")


def level_for(names: Iterable[str]) -> str:
    """Return an action level at which all observations exist."""
    return "frontier" if any(name in LEVEL_OBSERVABLES for name in names) else "velocity"


def egocentric_scales_of(scales: Iterable[int]) -> tuple[int, ...]:
    """Return the scales of the egocentric map as a tuple, checked."""
    wanted = f"want one or more whole numbers from 1 to {MAX_EGOCENTRIC_SCALE}, in a list or tuple"
    if isinstance(scales, str) or not isinstance(scales, Iterable):
        raise ValueError(f"egocentric_scales is {shown(scales)}; {wanted}")
    scales = tuple(scales)
    if len(scales) > MAX_SCALES:
        raise ValueError(f"egocentric_scales has {len(scales)} scales; want at most {MAX_SCALES}")
    for scale in scales:
        if isinstance(scale, bool) or not isinstance(scale, Integral) or not 1 <= scale <= MAX_EGOCENTRIC_SCALE:
            raise ValueError(f"egocentric_scales is {shown(scales)}; {wanted}")
    if not scales:
        raise ValueError(f"egocentric_scales is empty ({scales}); {wanted}")
    return tuple(int(scale) for scale in scales)
