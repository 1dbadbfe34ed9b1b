"""Radio: which robots reach each other, by distance, by line of sight, or by signal strength through walls.

References
----------
Path loss through obstacles, parameters and threshold of ``signal``: IR2 (Tan et al., "IR2: Implicit Rendezvous for Robotic Exploration
Teams under Sparse Intermittent Connectivity", IROS 2024); its pixels are taken as 0.1 m.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.floors.floor import Raster
from lidarium.mapping.checks import check_from_zero, check_positive
from lidarium.mapping.kernels import Array, kernel

RADIO_KINDS = ("all", "none", "range", "line_of_sight", "signal")
"""How robots reach each other."""

RADIO_STREAM = 0x72616469
"""Sets the draws of the radio apart from others of the same seed."""

OBSTACLE_UNIT = 0.1
"""Length of wall that costs nothing beside the fixed loss of a wall, the unit of the formula's obstacle length [m]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RadioSettings:
    """How robots of a team reach each other.

    Attributes
    ----------
    kind : str
        ``all``, ``none``, ``range`` (within ``reach``), ``line_of_sight`` (within ``reach`` and nothing solid between) or ``signal``
        (``power`` less the path loss is above ``threshold``).
    reach : float
        Of ``range`` and ``line_of_sight`` [m].
    power, threshold : float
        Of the sender, and what the receiver needs [dBm].
    reference_distance, reference_loss : float
        Where the loss in free space is known [m], and what it is there [dB].
    free_exponent, wall_exponent : float
        How loss grows with the free way and with the way through what is solid [1].
    wall_loss : float
        Loss where anything solid is between [dB].
    shadowing : float
        Standard deviation of what a link loses or gains by chance, drawn at every exchange [dB].
    loss : float
        Probability that a message is lost [1].
    latency_s : float
        Time until a message arrives [s].
    period_s : float
        Time between exchanges of maps; poses are told in every step [s].
    """

    kind: str = "all"
    reach: float = 10.0
    power: float = -20.0
    threshold: float = -70.0
    reference_distance: float = 3.5
    reference_loss: float = 31.0
    free_exponent: float = 2.0
    wall_exponent: float = 4.0
    wall_loss: float = 6.5
    shadowing: float = 0.0
    loss: float = 0.0
    latency_s: float = 0.0
    period_s: float = 1.0

    def __post_init__(self) -> None:
        if self.kind not in RADIO_KINDS:
            raise ValueError(f"kind of the radio is {self.kind!r}; want one of {', '.join(RADIO_KINDS)}")
        check_positive(self, "the radio", ("reach", "reference_distance", "period_s"))
        check_from_zero(self, "the radio", ("free_exponent", "wall_exponent", "wall_loss", "shadowing", "latency_s"))
        for name in ("power", "threshold", "reference_loss"):
            if not math.isfinite(getattr(self, name)):
                raise ValueError(f"{name} of the radio is {getattr(self, name)}; want a finite number")
        if not 0.0 <= self.loss < 1.0:
            raise ValueError(f"loss of the radio is {self.loss}; want a probability in [0, 1)")

    @property
    def is_ideal(self) -> bool:
        """Whether every message reaches everybody at once."""
        return self.kind == "all" and self.loss == 0.0 and self.latency_s == 0.0


RADIO: dict[str, RadioSettings] = {kind: RadioSettings(kind=kind) for kind in RADIO_KINDS}
"""Radios by name."""


@kernel
def solid_length(solid: Array, x: float, y: float, to_x: float, to_y: float) -> float:
    """Length of a line within solid cells, from x, y to another place, in cells; beyond the raster nothing is solid (kernel).

    Parameters
    ----------
    solid : (rows, columns) uint8
        1 where the world is solid.
    x, y, to_x, to_y : float
        The ends of the line [cells].
    """
    gap_x, gap_y = to_x - x, to_y - y
    length = math.hypot(gap_x, gap_y)
    if length == 0.0:
        return 0.0
    column, row = int(math.floor(x)), int(math.floor(y))
    step_x, step_y = (1 if gap_x > 0.0 else -1), (1 if gap_y > 0.0 else -1)
    every_x = 1.0 / abs(gap_x) if gap_x != 0.0 else math.inf
    every_y = 1.0 / abs(gap_y) if gap_y != 0.0 else math.inf
    next_x = ((column + (1 if step_x > 0 else 0)) - x) / gap_x if gap_x != 0.0 else math.inf
    next_y = ((row + (1 if step_y > 0 else 0)) - y) / gap_y if gap_y != 0.0 else math.inf
    share, inside = 0.0, 0.0
    while share < 1.0:
        after = min(next_x, next_y, 1.0)
        if 0 <= row < solid.shape[0] and 0 <= column < solid.shape[1] and solid[row, column] != 0:
            inside += after - share
        share = after
        if next_x <= next_y:
            column += step_x
            next_x += every_x
        else:
            row += step_y
            next_y += every_y
    return inside * length


@kernel
def _wall_lengths(solid: Array, places: Array, lengths: Array) -> None:
    """Fill ``lengths`` (robots, robots) with how much of the line between any two places (robots, 2) is solid, all in cells."""
    for i in range(places.shape[0]):
        lengths[i, i] = 0.0
        for j in range(i):
            lengths[i, j] = lengths[j, i] = solid_length(solid, places[i, 0], places[i, 1], places[j, 0], places[j, 1])


def path_loss(settings: RadioSettings, distance: NDArray[np.float64], walls: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the loss over a distance of which a part runs through what is solid [dB].

    Parameters
    ----------
    settings : RadioSettings
        Parameters of the formula ``PL = PL0 + 10 g_wall log10(d_wall) + K + 10 g log10(d_free / d0) + X``, without ``X``.
    distance, walls : (...) float64
        Length of the whole way, and of what is solid of it [m]. Less than ``reference_distance`` of free way loses no less than it does.
    """
    free = np.maximum(distance - walls, 0.0)
    loss = settings.reference_loss + 10.0 * settings.free_exponent * np.log10(np.maximum(free / settings.reference_distance, 1.0))
    through = settings.wall_loss + 10.0 * settings.wall_exponent * np.log10(np.maximum(walls / OBSTACLE_UNIT, 1.0))
    return np.asarray(loss + np.where(walls > 0.0, through, 0.0), np.float64)


def _reached(
    settings: RadioSettings, distance: NDArray[np.float64], walls: NDArray[np.float64], chance: NDArray[np.float64] | None
) -> NDArray[np.bool_]:
    """Return over which ways a message comes, by their lengths and what of them is solid [m], and the draws for the shadowing."""
    if settings.kind in ("all", "none"):
        return np.full(distance.shape, settings.kind == "all")
    if settings.kind == "range":
        return np.asarray(distance <= settings.reach)
    if settings.kind == "line_of_sight":
        return np.asarray((distance <= settings.reach) & (walls == 0.0))
    loss = path_loss(settings, distance, walls)
    if chance is not None:
        loss = loss + settings.shadowing * chance
    return np.asarray(settings.power - loss > settings.threshold)


def _asks_for_walls(settings: RadioSettings) -> bool:
    return settings.kind in ("line_of_sight", "signal")


def links(
    settings: RadioSettings, places: NDArray[np.float64], raster: Raster, chance: NDArray[np.float64] | None = None
) -> NDArray[np.bool_]:
    """Return which robots reach each other, (robots, robots), none itself.

    Parameters
    ----------
    settings : RadioSettings
        The radio.
    places : (robots, 2 or more) float64
        True places of the robots [m].
    raster : Raster
        What is solid.
    chance : (robots, robots) float64 or None
        Standard Gaussian draws for the shadowing, of which those above the diagonal count; none where None.
    """
    robots = len(places)
    distance = np.hypot(places[:, None, 0] - places[None, :, 0], places[:, None, 1] - places[None, :, 1])
    walls = np.zeros((robots, robots))
    if _asks_for_walls(settings):
        _wall_lengths(raster.solid, (places[:, :2] - raster.origin) / raster.resolution, walls)
        walls *= raster.resolution
    above = None if chance is None else np.triu(chance, 1)
    return np.asarray(_reached(settings, distance, walls, None if above is None else above + above.T) & ~np.eye(robots, dtype=np.bool_))


def links_to(
    settings: RadioSettings,
    places: NDArray[np.float64],
    place: NDArray[np.float64],
    raster: Raster,
    chance: NDArray[np.float64] | None = None,
) -> NDArray[np.bool_]:
    """Return which robots reach a place, and are reached from it, (robots,).

    Parameters
    ----------
    settings, places, raster : as of ``links``
        The radio, the robots and the floor.
    place : (2,) float64
        Where the other end is [m].
    chance : (robots,) float64 or None
        Standard Gaussian draws for the shadowing; none where None.
    """
    distance = np.hypot(places[:, 0] - place[0], places[:, 1] - place[1])
    walls = np.zeros(len(places))
    if _asks_for_walls(settings):
        ends = (np.vstack([places[:, :2], place[None, :2]]) - raster.origin) / raster.resolution
        x, y = ends[-1].tolist()
        walls[:] = [solid_length(raster.solid, from_x, from_y, x, y) for from_x, from_y in ends[:-1].tolist()]
        walls *= raster.resolution
    return _reached(settings, distance, walls, chance)
