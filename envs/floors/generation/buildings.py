"""Generated buildings: from a seed to a floor that a robot can pass."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from lidarium.envs.floors.floor import Floor, Raster, Solid
from lidarium.envs.floors.free_space import configuration_space
from lidarium.envs.floors.generation.furniture import Furnished, furnish
from lidarium.envs.floors.generation.layouts import (
    OUTSIDE,
    Labels,
    Proportions,
    Rectangle,
    apartment_layout,
    cells,
    choose_doors,
    corridor_layout,
    metres,
    office_layout,
    outside_rectangles,
    room_areas,
    wall_rectangles,
)


def _solid_of(rectangle: Rectangle, z_high: float = math.inf) -> Solid:
    """Return the solid on a rectangle, from the ground up to a height [m]."""
    x_low, y_low, x_high, y_high = (round(value, 4) for value in rectangle)
    return Solid(np.array([(x_low, y_low), (x_high, y_low), (x_high, y_high), (x_low, y_high)]), 0.0, z_high)


def _rotated(floor: Floor, angle: float) -> Floor:
    """Turn a floor about its corner and move it back to the first quadrant.

    The corners that open are filled.
    """
    if angle == 0.0:
        return floor
    cosine, sine = math.cos(angle), math.sin(angle)
    turn = np.array([[cosine, -sine], [sine, cosine]])
    x_high, y_high = floor.bounds[2:]
    corners = np.array([(0.0, 0.0), (x_high, 0.0), (x_high, y_high), (0.0, y_high)]) @ turn.T
    shift = -corners.min(axis=0)
    corners = corners + shift
    extent = corners.max(axis=0)

    def moved(points: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(np.round(points @ turn.T + shift, 4) + 0.0)

    solids = [Solid(moved(solid.polygon), solid.z_low, solid.z_high) for solid in floor.solids]
    for k in range(4):
        a, b = corners[k], corners[(k + 1) % 4]
        apex = next(
            corner
            for corner in ((a[0], b[1]), (b[0], a[1]))
            if any(abs(corner[0] - x) < 1e-9 for x in (0.0, extent[0]))
            and any(abs(corner[1] - y) < 1e-9 for y in (0.0, extent[1]))
        )
        if np.abs(a - apex).max() > 1e-3 and np.abs(b - apex).max() > 1e-3:
            solids.append(Solid(np.asarray(np.round(np.array([a, b, apex]), 4) + 0.0, np.float64)))
    headings = np.arctan2(np.sin(floor.starts[:, 2] + angle), np.cos(floor.starts[:, 2] + angle))
    starts = np.asarray(np.column_stack([moved(floor.starts[:, :2]), np.round(headings, 4)]), np.float64)
    return Floor(
        floor.name,
        (0.0, 0.0, round(float(extent[0]), 4), round(float(extent[1]), 4)),
        tuple(solids),
        starts=starts,
    )


ROBOT_RADIUS = 0.30
"""Radius of the largest robot, which must be able to go everywhere [m]."""

MARGIN = 0.05
"""Clearance beyond that radius [m]."""

START_CLEARANCE = 0.5
"""Minimum distance of a start from all obstacles [m]."""

STARTS = 3
"""Number of starts a floor has."""

_CHECK_RESOLUTION = 0.05


def _passable(
    bounds: Rectangle, walls: tuple[Solid, ...], furniture: list[Furnished], labels: Labels
) -> tuple[list[Furnished], NDArray[np.bool_], tuple[float, float]] | None:
    """Leave out furniture until a disc can go everywhere; also if a start may be.

    None if no furniture is in the way.
    """
    resolution = _CHECK_RESOLUTION
    while True:
        blocks = walls + tuple(_solid_of(piece.footprint, 1.0) for piece in furniture)
        raster = Floor("check", bounds, blocks).raster(resolution, 0.0, 0.5)
        space, reachable = _space(raster, ROBOT_RADIUS + MARGIN)
        tight, tight_reachable = _space(raster, ROBOT_RADIUS)
        room = _room_of_cells(labels, raster.solid.shape, raster.origin, resolution)
        reached = np.bincount(room[reachable & (room >= 0)], minlength=int(labels.max()) + 1) > 0
        missed = {k for k, area in enumerate(room_areas(labels)) if area > 0 and not reached[k]}
        # With the margin passages are wide enough; without it nooks appear that are cut off.
        stray = (space & ~reachable) | (tight & ~tight_reachable)
        if not missed and not stray.any():
            clear = configuration_space(raster, START_CLEARANCE + MARGIN)
            return furniture, clear if clear.any() else space, raster.origin
        if not furniture:
            return None
        guilty = _guilty(furniture, stray, missed, raster.origin)
        furniture = furniture[:guilty] + furniture[guilty + 1 :]


def _space(raster: Raster, radius: float) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return the positions at which a disc fits, and the largest connected part of that."""
    space = configuration_space(raster, radius)
    count, parts, stats, _ = cv2.connectedComponentsWithStats(space.astype(np.uint8), connectivity=4)
    largest = 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA])) if count > 1 else -1
    return space, np.asarray(parts == largest)


def _guilty(furniture: list[Furnished], stray: NDArray[np.bool_], missed: set[int], origin: tuple[float, float]) -> int:
    """Return the index of the last piece of furniture that obstructs the floor.

    Such a piece is next to a part cut off or in a room that is not reached. Otherwise the last piece is returned.
    """
    reach = ROBOT_RADIUS + 3 * MARGIN
    corner = np.tile(origin, 2) + np.array([reach, reach, -reach, -reach])
    for k in range(len(furniture) - 1, -1, -1):
        left, low, right, high = np.maximum(
            (np.array(furniture[k].footprint) - corner) / _CHECK_RESOLUTION, 0.0
        ).astype(int)
        if furniture[k].room in missed or stray[low : high + 1, left : right + 1].any():
            return k
    return len(furniture) - 1


def _room_of_cells(labels: Labels, shape: tuple[int, ...], origin: tuple[float, float], resolution: float) -> Labels:
    """Label of the room under each cell of a raster."""
    index = []
    for axis in (0, 1):
        centres = origin[1 - axis] + (np.arange(shape[axis]) + 0.5) * resolution
        index.append(np.clip(np.floor(centres / metres(1)).astype(int), 0, labels.shape[axis] - 1))
    return labels[np.ix_(index[0], index[1])]


def _draw_starts(
    clear: NDArray[np.bool_], origin: tuple[float, float], generator: np.random.Generator
) -> NDArray[np.float64]:
    """Choose starts well off all walls, each as far as can be from the others.

    Headings are drawn.
    """
    rows, columns = np.nonzero(clear)
    places = (np.column_stack([columns, rows]) + 0.5) * _CHECK_RESOLUTION + origin
    anywhere = places[int(generator.integers(len(places)))]
    chosen = [places[int(np.argmax(((places - anywhere) ** 2).sum(axis=1)))]]
    while len(chosen) < STARTS:
        nearest = np.min([((places - place) ** 2).sum(axis=1) for place in chosen], axis=0)
        chosen.append(places[int(np.argmax(nearest))])
    headings = generator.uniform(-math.pi, math.pi, STARTS)
    return np.round(np.column_stack([np.array(chosen), headings]), 4)


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
    """Parameters of a building. Those that are None are drawn from the seed.

    Attributes
    ----------
    kind : str, default "any"
        "apartment", "office", "corridors", or "any", drawn by the seed.
    area_m2 : float or None
        Floor area between the walls, furniture not subtracted [m²]; 30 to 1500. Drawn: 40 to 120 for an
        apartment, 150 to 600 for an office, 80 to 250 for corridors.
    loops : float or None
        Share of the possible openings beyond those that join all rooms, 0 (a tree of rooms, but for ring
        corridors of offices) to 1. Drawn: 0 to 0.5.
    clutter : float or None
        Share of that area under furniture, 0 to 0.3. Furniture without enough room is left out, so that about 0.2 is
        reached if more is asked for. Drawn: 0.08 to 0.24; 0 to 0.1 for corridors.
    door_width : float, default 0.9
        Clear width of doors [m], 0.8 to 1.0.
    corridor_width : float or None
        Width of hall or corridors between the middles of their walls [m], 1.2 to 4. Drawn: 1.3 to 1.6 for an
        apartment, 1.7 to 2.3 for an office, 1.5 to 2.4 for corridors.
    wall_thickness : float, default 0.1
        Thickness of the walls between rooms [m], 0.05 to 0.3.
    outer_wall_thickness : float, default 0.2
        Thickness of the walls around the floor [m], 0.1 to 1; rounded to 0.1.
    room_size : (float, float)
        Smallest and largest frontage of a usual room [m]; baths and kitchens of apartments are narrower. The
        smallest is at least 2, the largest at least 1.5 times that.
    rotation : float, default 0.0
        Counter-clockwise rotation of the floor [rad].
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
    """Generate a floor with rooms, doors, loops and furniture from a seed.

    Parameters
    ----------
    seed : int
        Seed of all draws; the same seed and settings give the same floor.
    settings : BuildingSettings, optional
        Type, area, loops and clutter; by default all are drawn from the seed.

    Returns
    -------
    Floor
        A floor that is connected for a robot of radius 0.30 m, with three starts.

    Raises
    ------
    ValueError
        If the seed is negative, or no passable floor is found.

    Examples
    --------
    >>> import lidarium
    >>> office = lidarium.generate_building(7, lidarium.BuildingSettings(kind="office", area_m2=300.0))
    >>> office.name, len(office.starts)
    ('office:7', 3)
    """
    if seed < 0:
        raise ValueError(f"seed is {seed}; want zero or more")
    settings = settings or BuildingSettings()
    # One generator per stage, so that the knob of one stage leaves the draws of the others alone.
    shape, *stages = np.random.SeedSequence(seed).spawn(1 + 4 * _ATTEMPTS)
    kind, proportions, clutter = _drawn(settings, np.random.default_rng(shape))
    for attempt in range(_ATTEMPTS):
        floor = _attempt(f"{kind}:{seed}", kind, proportions, clutter, settings, stages[4 * attempt : 4 * attempt + 4])
        if floor is not None:
            return _rotated(floor, settings.rotation)
    raise ValueError(
        f"no passable {kind} came out of seed {seed} and {settings}; try another seed, wider corridors or larger rooms"
    )


def _attempt(
    name: str,
    kind: str,
    proportions: Proportions,
    clutter: float,
    settings: BuildingSettings,
    stages: list[np.random.SeedSequence],
) -> Floor | None:
    """Draw one floor, or return None if its plan fails.

    A plan fails if a room has no door or a neck is too narrow for the robot.
    """
    layout, openings, pieces, places = stages
    labels = _layout(kind, proportions, settings, layout)
    doors = choose_doors(labels, settings.door_width, proportions.loops, np.random.default_rng(openings))
    if doors is None:
        return None
    walls = tuple(
        _solid_of(r) for r in outside_rectangles(labels) + wall_rectangles(labels, doors, settings.wall_thickness)
    )
    bounds = (0.0, 0.0, metres(labels.shape[1]), metres(labels.shape[0]))
    furniture = furnish(kind, labels, doors, clutter, settings.wall_thickness, np.random.default_rng(pieces))
    found = _passable(bounds, walls, furniture, labels)
    if found is None:
        return None
    furniture, clear, origin = found
    starts = _draw_starts(clear, origin, np.random.default_rng(places))
    return Floor(name, bounds, walls + tuple(solid for piece in furniture for solid in piece.solids), starts=starts)


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


def _layout(kind: str, proportions: Proportions, settings: BuildingSettings, seed: np.random.SeedSequence) -> Labels:
    """Draw a layout of the wanted area, with outer walls around it.

    It is drawn again with its area corrected for the area of walls and cut corners.
    """
    wanted = proportions.area_m2
    margin = cells(settings.outer_wall_thickness)
    best: tuple[float, Labels] | None = None
    gross = wanted
    for _ in range(6):
        drawn = Proportions(gross, proportions.corridor_width, proportions.room_size, proportions.loops)
        labels = np.pad(_LAYOUTS[kind](drawn, np.random.default_rng(seed)), margin, constant_values=OUTSIDE)
        walls = sum((r[2] - r[0]) * (r[3] - r[1]) for r in wall_rectangles(labels, [], settings.wall_thickness))
        area = float(room_areas(labels).sum()) - walls
        if best is None or abs(area - wanted) < abs(best[0] - wanted):
            best = area, labels
        if abs(area - wanted) < 0.03 * wanted:
            break
        gross *= wanted / area
    assert best is not None
    return best[1]
