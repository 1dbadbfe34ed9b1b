"""Plans: the room of each lattice cell, and the walls and doors that follow.

A plan is an integer image, one value per room, on a lattice of 0.1 m; rooms of any shape are drawn by
painting rectangles. Walls stand where two rooms meet, doors are gaps in them, and all that is no room is
solid.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

CELL = 0.1
"""Side of a lattice cell [m]."""

OUTSIDE = -1
"""Label of what is no room."""

HALL = 0
"""Label of the space from which the rooms are reached: hall or corridors."""

JAMB = 0.15
"""Least distance of a door from the end of its wall [m]."""

SMALL_ROOM_M2 = 5.0
"""Rooms below this area have one door only: nobody walks through a bathroom."""

Labels = NDArray[np.int32]
Rectangle = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class Boundary:
    """A straight piece of the line where two rooms meet.

    Attributes
    ----------
    vertical : bool
        True where it runs along y.
    position : float
        The constant coordinate, x of a vertical boundary and y of a horizontal one [m].
    start, end : float
        Range of the other coordinate [m].
    low, high : int
        Labels at the side of the smaller and of the larger constant coordinate.
    """

    vertical: bool
    position: float
    start: float
    end: float
    low: int
    high: int

    @property
    def length(self) -> float:
        """Length [m]."""
        return self.end - self.start

    def rectangle(self, start: float, end: float, below: float, above: float) -> Rectangle:
        """Return a rectangle over part of the line.

        It reaches `below` and `above` metres to the two sides of the line.
        """
        if self.vertical:
            return (self.position - below, start, self.position + above, end)
        return (start, self.position - below, end, self.position + above)


@dataclass(frozen=True, slots=True)
class Door:
    """A gap in the wall on a boundary, from `start` to `end` metres."""

    boundary: Boundary
    start: float
    end: float


def cells(length: float) -> int:
    """Lattice cells in a length [m]."""
    return round(length / CELL)


def metres(count: float) -> float:
    """Length of so many lattice cells [m], without the dust of binary fractions."""
    return round(float(count) * CELL, 6)


def boundaries(labels: Labels) -> list[Boundary]:
    """Return all maximal straight boundaries between different labels.

    Boundaries with the outside are included.

    Parameters
    ----------
    labels : (rows, columns) int32
        The plan; its outer ring must be outside.

    Returns
    -------
    list of Boundary
        Vertical ones first, then by position and start.
    """
    found = []
    for vertical in (True, False):
        image = labels.T if vertical else labels
        low, high = image[:-1], image[1:]
        span = int(labels.max()) + 2
        code = np.where(low != high, (low + 1) * span + high + 1, -1)
        code = np.pad(code, ((0, 0), (1, 1)), constant_values=-1)
        line, changed = np.nonzero(code[:, 1:] != code[:, :-1])
        value = code[line, changed + 1]
        for k in np.flatnonzero(value >= 0):
            pair = int(value[k])
            found.append(
                Boundary(
                    vertical,
                    metres(line[k] + 1),
                    metres(changed[k]),
                    metres(changed[k + 1]),
                    pair // span - 1,
                    pair % span - 1,
                )
            )
    return found


def room_areas(labels: Labels) -> NDArray[np.float64]:
    """Area of each room by label [m²], up to the middle of its walls."""
    return np.asarray(np.bincount(labels[labels >= 0], minlength=1) * CELL**2, dtype=np.float64)


def choose_doors(
    labels: Labels, door_width: float, loops: float, generator: np.random.Generator
) -> list[Door] | None:
    """Choose doors that join all rooms, and a share of the further possible ones.

    Rooms are joined from the hall where possible.

    Parameters
    ----------
    labels : (rows, columns) int32
        The plan.
    door_width : float
        Clear width of every door [m].
    loops : float
        Share of the further possible doors that are made, 0 to 1; a larger share keeps all doors of a smaller
        one.
    generator : np.random.Generator
        Source of all draws.

    Returns
    -------
    list of Door or None
        None if some room has no wall long enough for a door to the others.
    """
    areas = room_areas(labels)
    candidates = [
        b for b in boundaries(labels) if b.low >= 0 and b.high >= 0 and b.length >= door_width + 2 * JAMB
    ]
    order = [candidates[k] for k in generator.permutation(len(candidates))]
    order.sort(key=lambda b: HALL not in (b.low, b.high))
    group = list(range(len(areas)))
    joining, further = [], []
    for boundary in order:
        a, b = group[boundary.low], group[boundary.high]
        if a != b:
            joining.append(boundary)
            group = [a if g == b else g for g in group]
        elif min(areas[boundary.low], areas[boundary.high]) >= SMALL_ROOM_M2:
            further.append(boundary)
    if len({group[k] for k in range(len(areas)) if areas[k] > 0}) > 1:
        return None
    further = [further[k] for k in generator.permutation(len(further))][: round(loops * len(further))]
    return [_door(b, door_width, generator) for b in joining + further]


def _door(boundary: Boundary, width: float, generator: np.random.Generator) -> Door:
    """Make a door near one end of the wall, as most are, or anywhere in it."""
    # A wall that is just long enough may be shorter by a rounding.
    slack = max(boundary.length - width - 2 * JAMB, 0.0)
    near_end = min(slack, 0.1 * int(generator.integers(0, 4)))
    offset = (near_end, slack - near_end, 0.05 * int(generator.uniform(0.0, slack) / 0.05))[
        int(generator.choice(3, p=(0.4, 0.4, 0.2)))
    ]
    start = round(boundary.start + JAMB + offset, 6)
    return Door(boundary, start, round(start + width, 6))


def wall_rectangles(labels: Labels, doors: list[Door], thickness: float) -> list[Rectangle]:
    """Walls between rooms as rectangles, doors left open.

    Boundaries on one line are one wall, and walls reach half their thickness beyond their ends, so that
    corners close.
    """
    half = thickness / 2
    gaps: dict[tuple[bool, float], list[tuple[float, float]]] = {}
    for door in doors:
        gaps.setdefault((door.boundary.vertical, door.boundary.position), []).append((door.start, door.end))
    lines: dict[tuple[bool, float], list[list[float]]] = {}
    inner = [b for b in boundaries(labels) if b.low >= 0 and b.high >= 0]
    for b in inner:
        pieces = lines.setdefault((b.vertical, b.position), [])
        if pieces and pieces[-1][1] == b.start:
            pieces[-1][1] = b.end
        else:
            pieces.append([b.start, b.end])
    rectangles = []
    for (vertical, position), pieces in lines.items():
        for start, end in pieces:
            edges = [start - half]
            for low, high in sorted(
                gap for gap in gaps.get((vertical, position), []) if start <= gap[0] and gap[1] <= end
            ):
                edges += [low, high]
            edges.append(end + half)
            line = Boundary(vertical, position, start, end, 0, 0)
            rectangles += [
                line.rectangle(edges[k], edges[k + 1], half, half) for k in range(0, len(edges), 2)
            ]
    return rectangles


def outside_rectangles(labels: Labels) -> list[Rectangle]:
    """Cut everything outside the rooms into few rectangles.

    These are runs of cells of a row, joined over rows that have the same run.
    """
    open_runs: dict[tuple[int, int], int] = {}
    rectangles = []
    empty = np.zeros((1, labels.shape[1]), dtype=bool)
    for row, outside in enumerate(np.vstack([labels == OUTSIDE, empty])):
        edges = np.flatnonzero(np.diff(outside, prepend=False, append=False))
        runs = {(int(edges[k]), int(edges[k + 1])) for k in range(0, len(edges), 2)}
        for first, last in sorted(open_runs.keys() - runs):
            rectangles.append(
                (metres(first), metres(open_runs.pop((first, last))), metres(last), metres(row))
            )
        for run in sorted(runs - open_runs.keys()):
            open_runs[run] = row
    return rectangles
