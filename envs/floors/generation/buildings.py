"""Generated buildings: apartments, offices and corridor networks.

They are drawn by seed from a few settings.

A layout (rooms on a lattice) gives walls and doors; furniture is set into the rooms; then a disc of the
service robot's radius is tried in all of it, and furniture that cuts off a part is left out. The same seed
and settings give the same floor to the bit.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from lidarium.envs.floors.floor import Floor
from lidarium.envs.floors.generation.furnishing import furnish
from lidarium.envs.floors.generation.layouts import (
    Proportions,
    apartment_layout,
    corridor_layout,
    office_layout,
)
from lidarium.envs.floors.generation.passability import draw_starts, passable
from lidarium.envs.floors.generation.plans import (
    OUTSIDE,
    Labels,
    cells,
    choose_doors,
    metres,
    outside_rectangles,
    room_areas,
    wall_rectangles,
)
from lidarium.envs.floors.generation.solids import rotated, solid_of

KINDS = ("apartment", "office", "corridors")

_ATTEMPTS = 8

_AREAS = {"apartment": (40.0, 120.0), "office": (150.0, 600.0), "corridors": (80.0, 250.0)}
_CORRIDORS = {"apartment": (1.3, 1.6), "office": (1.7, 2.3), "corridors": (1.5, 2.4)}
_LAYOUTS: dict[str, Callable[[Proportions, np.random.Generator], Labels]] = {
    "apartment": apartment_layout,
    "office": office_layout,
    "corridors": corridor_layout,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class BuildingSettings:
    """What to build. What is None is drawn by the seed.

    Attributes
    ----------
    kind : str
        "apartment", "office", "corridors", or "any", drawn by the seed.
    area_m2 : float or None
        Floor area between the walls, furniture not subtracted [m²]; 30 to 1500. Drawn: 40 to 120 for an
        apartment, 150 to 600 for an office, 80 to 250 for corridors.
    loops : float or None
        Share of the possible openings beyond those that join all rooms, 0 (a tree of rooms, but for ring
        corridors of offices) to 1. Drawn: 0 to 0.5.
    clutter : float or None
        Share of that area under furniture, 0 to 0.3. What finds no place is left out, so that about 0.2 is
        reached where more is asked for. Drawn: 0.08 to 0.24; 0 to 0.1 for corridors.
    door_width : float
        Clear width of doors [m], 0.8 to 1.0.
    corridor_width : float or None
        Width of hall or corridors between the middles of their walls [m], 1.2 to 4. Drawn: 1.3 to 1.6 for an
        apartment, 1.7 to 2.3 for an office, 1.5 to 2.4 for corridors.
    wall_thickness : float
        Of the walls between rooms [m], 0.05 to 0.3.
    outer_wall_thickness : float
        Of the walls around the floor [m], 0.1 to 1; rounded to 0.1.
    room_size : (float, float)
        Smallest and largest frontage of a usual room [m]; baths and kitchens of apartments are narrower. The
        smallest is at least 2, the largest at least 1.5 times that.
    rotation : float
        By which the floor is turned counter-clockwise [rad].

    Raises
    ------
    ValueError
        If a value is out of its range.
    """

    kind: str = "any"
    area_m2: float | None = None
    loops: float | None = None
    clutter: float | None = None
    door_width: float = 0.9
    corridor_width: float | None = None
    wall_thickness: float = 0.1
    outer_wall_thickness: float = 0.2
    room_size: tuple[float, float] = (2.4, 5.2)
    rotation: float = 0.0

    def __post_init__(self) -> None:
        if self.kind not in (*KINDS, "any"):
            raise ValueError(f"kind is {self.kind!r}; want one of {', '.join(KINDS)} or any")
        for name, low, high, unit in (
            ("area_m2", 30.0, 1500.0, " m²"),
            ("loops", 0.0, 1.0, ""),
            ("clutter", 0.0, 0.3, ""),
            ("door_width", 0.8, 1.0, " m"),
            ("corridor_width", 1.2, 4.0, " m"),
            ("wall_thickness", 0.05, 0.3, " m"),
            ("outer_wall_thickness", 0.1, 1.0, " m"),
        ):
            value = getattr(self, name)
            if value is not None and not low <= value <= high:
                raise ValueError(f"{name} is {value}; want {low:g} to {high:g}{unit}")
        small, large = self.room_size
        if not (small >= 2.0 and 1.5 * small <= large <= 20.0):
            raise ValueError(
                f"room_size is {self.room_size}; want 2 m or more and a largest of at least 1.5 times that, "
                "20 m at most"
            )
        if not math.isfinite(self.rotation):
            raise ValueError(f"rotation is {self.rotation}; want a finite angle in radians")


def generate_building(seed: int, settings: BuildingSettings | None = None) -> Floor:
    """Build a floor.

    Parameters
    ----------
    seed : int
        Seed of all draws, not negative.
    settings : BuildingSettings, optional
        What to build; without it a building of any kind.

    Returns
    -------
    Floor
        One connected floor with three starts far apart, named by its kind and seed. Walls reach the ceiling,
        furniture does not.

    Raises
    ------
    ValueError
        If the seed is negative, or no such building comes out, which very unusual settings may cause.
    """
    if seed < 0:
        raise ValueError(f"seed is {seed}; want zero or more")
    settings = settings or BuildingSettings()
    # One generator per stage, so that the knob of one stage leaves the draws of the others alone.
    shape, *stages = np.random.SeedSequence(seed).spawn(1 + 4 * _ATTEMPTS)
    kind, proportions, clutter = _drawn(settings, np.random.default_rng(shape))
    for attempt in range(_ATTEMPTS):
        floor = _attempt(
            f"{kind}:{seed}", kind, proportions, clutter, settings, stages[4 * attempt : 4 * attempt + 4]
        )
        if floor is not None:
            return rotated(floor, settings.rotation)
    raise ValueError(
        f"no passable {kind} came out of seed {seed} and {settings}; try another seed, wider corridors or "
        "larger rooms"
    )


def _attempt(
    name: str,
    kind: str,
    proportions: Proportions,
    clutter: float,
    settings: BuildingSettings,
    stages: list[np.random.SeedSequence],
) -> Floor | None:
    """Draw one floor, or return None where its plan fails.

    A plan fails where a room has no door or a neck is too narrow for the robot.
    """
    layout, openings, pieces, places = stages
    labels = _layout(kind, proportions, settings, layout)
    doors = choose_doors(labels, settings.door_width, proportions.loops, np.random.default_rng(openings))
    if doors is None:
        return None
    walls = tuple(
        solid_of(r)
        for r in outside_rectangles(labels) + wall_rectangles(labels, doors, settings.wall_thickness)
    )
    bounds = (0.0, 0.0, metres(labels.shape[1]), metres(labels.shape[0]))
    furniture = furnish(kind, labels, doors, clutter, settings.wall_thickness, np.random.default_rng(pieces))
    found = passable(bounds, walls, furniture, labels)
    if found is None:
        return None
    furniture, clear, origin = found
    starts = draw_starts(clear, origin, np.random.default_rng(places))
    return Floor(
        name, bounds, walls + tuple(solid for piece in furniture for solid in piece.solids), starts=starts
    )


def _drawn(settings: BuildingSettings, generator: np.random.Generator) -> tuple[str, Proportions, float]:
    """Kind, proportions and clutter.

    Every value is drawn whether it is given or not, so that giving one moves no other.
    """
    kind = KINDS[int(generator.choice(3, p=(0.45, 0.4, 0.15)))]
    kind = kind if settings.kind == "any" else settings.kind
    quantities = generator.random(4)
    spans = (_AREAS[kind], (0.0, 0.5), (0.0, 0.1) if kind == "corridors" else (0.08, 0.24), _CORRIDORS[kind])
    area, loops, clutter, corridor = (
        round(low + (high - low) * float(u), 2) if given is None else given
        for given, (low, high), u in zip(
            (settings.area_m2, settings.loops, settings.clutter, settings.corridor_width),
            spans,
            quantities,
            strict=True,
        )
    )
    return kind, Proportions(area, corridor, settings.room_size, loops), clutter


def _layout(
    kind: str, proportions: Proportions, settings: BuildingSettings, seed: np.random.SeedSequence
) -> Labels:
    """Draw a layout of the wanted area, with outer walls around it.

    It is drawn again with its area corrected for what walls and cut corners took.
    """
    wanted = proportions.area_m2
    margin = cells(settings.outer_wall_thickness)
    best: tuple[float, Labels] | None = None
    gross = wanted
    for _ in range(6):
        drawn = Proportions(gross, proportions.corridor_width, proportions.room_size, proportions.loops)
        labels = np.pad(_LAYOUTS[kind](drawn, np.random.default_rng(seed)), margin, constant_values=OUTSIDE)
        walls = sum(
            (r[2] - r[0]) * (r[3] - r[1]) for r in wall_rectangles(labels, [], settings.wall_thickness)
        )
        area = float(room_areas(labels).sum()) - walls
        if best is None or abs(area - wanted) < abs(best[0] - wanted):
            best = area, labels
        if abs(area - wanted) < 0.03 * wanted:
            break
        gross *= wanted / area
    assert best is not None
    return best[1]
