"""Furniture of generated buildings: pieces, wishes of rooms, and free positions for them."""

import math
from bisect import bisect_left
from collections.abc import Callable
from dataclasses import dataclass
from itertools import accumulate

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.floors.floor import Solid
from lidarium.envs.floors.generation.layouts import (
    CELL,
    Boundary,
    Door,
    Labels,
    Rectangle,
    boundaries,
    room_areas,
)

Box = tuple[float, float, float, float, float, float]


@dataclass(frozen=True, slots=True)
class _Piece:
    """A kind of furniture.

    Attributes
    ----------
    width, depth : (float, float)
        Smallest and largest size [m]; drawn floors take the middle by default.
    parts : callable
        Boxes of a piece of a given width and depth [m].
    """

    width: tuple[float, float]
    depth: tuple[float, float]
    parts: Callable[[float, float], list[Box]]


def _block(z_high: float) -> Callable[[float, float], list[Box]]:
    """Make a closed body from the floor up: wardrobe, shelf, counter."""
    return lambda width, depth: [(0.0, 0.0, width, depth, 0.0, z_high)]


def _legs(x: float, y: float, width: float, depth: float, side: float, z_high: float) -> list[Box]:
    """Four square legs in the corners of a rectangle."""
    return [
        (left, low, left + side, low + side, 0.0, z_high)
        for left in (x, x + width - side)
        for low in (y, y + depth - side)
    ]


def _table(width: float, depth: float) -> list[Box]:
    return [(0.0, 0.0, width, depth, 0.70, 0.75), *_legs(0.03, 0.03, width - 0.06, depth - 0.06, 0.05, 0.70)]


def _low_table(width: float, depth: float) -> list[Box]:
    return [(0.0, 0.0, width, depth, 0.0, 0.44)]


def _chair(width: float, depth: float, x: float = 0.0, y: float = 0.0, back_high: bool = True) -> list[Box]:
    back = y + depth - 0.04 if back_high else y
    return [
        (x, y, x + width, y + depth, 0.0, 0.46),
        (x, back, x + width, back + 0.04, 0.46, 0.90),
    ]


def _open_chair(width: float, depth: float) -> list[Box]:
    """Make a seat on four legs with a back."""
    return [
        (0.0, 0.0, width, depth, 0.42, 0.46),
        *_legs(0.0, 0.0, width, depth, 0.035, 0.42),
        (0.0, depth - 0.03, width, depth, 0.46, 0.90),
    ]


def _open_low_table(width: float, depth: float) -> list[Box]:
    return [(0.0, 0.0, width, depth, 0.40, 0.44), *_legs(0.02, 0.02, width - 0.04, depth - 0.04, 0.05, 0.40)]


def _office_chair(width: float, depth: float, x: float = 0.0, y: float = 0.0) -> list[Box]:
    return [
        (x, y, x + width, y + depth, 0.0, 0.52),
        (x + 0.05, y, x + width - 0.05, y + 0.06, 0.60, 1.05),
    ]


def _dining(width: float, depth: float) -> list[Box]:
    """Make a trestle table with chairs at its two long sides, half pushed in."""
    out, seat = 0.25, 0.42
    middle, ends = depth / 2, 0.25 * (depth - 2 * out)
    boxes: list[Box] = [
        (0.0, out, width, depth - out, 0.70, 0.75),
        (0.10, middle - 0.03, width - 0.10, middle + 0.03, 0.0, 0.70),
        (0.10, middle - ends, 0.15, middle + ends, 0.0, 0.70),
        (width - 0.15, middle - ends, width - 0.10, middle + ends, 0.0, 0.70),
    ]
    count = max(1, round(width / 0.6))
    for k in range(count):
        x = (k + 0.5) * width / count - seat / 2
        boxes += _chair(seat, seat, x, 0.0, back_high=False) + _chair(seat, seat, x, depth - seat)
    return boxes


def _office_desk(width: float, depth: float, x: float, y: float) -> list[Box]:
    """Make a top on two side panels."""
    sides = [(left, y, left + 0.04, y + depth, 0.0, 0.70) for left in (x, x + width - 0.04)]
    return [(x, y, x + width, y + depth, 0.70, 0.74), *sides]


def _desk(width: float, depth: float) -> list[Box]:
    """Make a desk with a drawer unit and an office chair half under it."""
    out, chair = 0.40, 0.56
    return [
        *_office_desk(width, depth - out, 0.0, out),
        (width - 0.48, out + 0.12, width - 0.08, depth, 0.0, 0.60),
        *_office_chair(chair, chair, 0.35 * width - chair / 2, 0.0),
    ]


def _desk_group(width: float, depth: float) -> list[Box]:
    """Desks face to face with a screen between them and a chair at each."""
    out, chair = 0.35, 0.56
    boxes: list[Box] = [(0.0, depth / 2 - 0.02, width, depth / 2 + 0.02, 0.0, 1.20)]
    count = max(1, round(width / 1.5))
    for k in range(count):
        x = k * width / count
        for y, seat in ((out, 0.0), (depth / 2, depth - chair)):
            boxes += _office_desk(width / count, depth / 2 - out, x, y)
            boxes += _office_chair(chair, chair, x + width / count / 2 - chair / 2, seat)
    return boxes


def _bed(width: float, depth: float) -> list[Box]:
    return [(0.0, 0.0, width, depth - 0.06, 0.0, 0.50), (0.0, depth - 0.06, width, depth, 0.0, 1.0)]


def _open_bed(width: float, depth: float) -> list[Box]:
    """Make a mattress on a frame with four legs and a head board down to the floor."""
    return [
        (0.0, 0.0, width, depth - 0.06, 0.30, 0.50),
        *_legs(0.0, 0.0, width, depth - 0.06, 0.06, 0.30),
        (0.0, depth - 0.06, width, depth, 0.0, 1.0),
    ]


def _open_shelf(width: float, depth: float) -> list[Box]:
    """Make a closed shelf on four feet."""
    return [(0.0, 0.0, width, depth, 0.12, 1.90), *_legs(0.0, 0.0, width, depth, 0.05, 0.12)]


def _sofa(width: float, depth: float) -> list[Box]:
    return [
        (0.18, 0.0, width - 0.18, depth - 0.25, 0.0, 0.42),
        (0.0, depth - 0.25, width, depth, 0.0, 0.82),
        (0.0, 0.0, 0.18, depth - 0.25, 0.0, 0.60),
        (width - 0.18, 0.0, width, depth - 0.25, 0.0, 0.60),
    ]


def _bench(width: float, depth: float) -> list[Box]:
    return [(0.0, 0.0, width, depth, 0.0, 0.47)]


def _seats(width: float, depth: float) -> list[Box]:
    """Make a row of waiting-room chairs on one rail."""
    return [
        (0.0, 0.0, width, depth, 0.0, 0.46),
        (0.0, depth - 0.05, width, depth, 0.46, 0.85),
    ]


def _basin(width: float, depth: float) -> list[Box]:
    return [
        (0.0, 0.0, width, depth, 0.70, 0.85),
        (width / 2 - 0.1, depth - 0.25, width / 2 + 0.1, depth, 0.0, 0.70),
    ]


def _toilet(width: float, depth: float) -> list[Box]:
    return [(0.0, 0.0, width, depth - 0.15, 0.0, 0.42), (0.0, depth - 0.15, width, depth, 0.0, 0.80)]


def _couch(width: float, depth: float) -> list[Box]:
    """Make an examination couch: a padded top on a narrower base."""
    return [(0.0, 0.0, width, depth, 0.60, 0.75), (0.15, 0.10, width - 0.15, depth - 0.10, 0.0, 0.60)]


PIECES: dict[str, _Piece] = {
    "armchair": _Piece((0.75, 0.90), (0.75, 0.85), _sofa),
    "basin": _Piece((0.50, 0.80), (0.40, 0.48), _basin),
    "bathtub": _Piece((1.60, 1.70), (0.70, 0.80), _block(0.57)),
    "bed": _Piece((1.40, 1.80), (2.05, 2.10), _bed),
    "bench": _Piece((1.00, 1.60), (0.35, 0.40), _bench),
    "box": _Piece((0.40, 0.80), (0.40, 0.60), _block(0.60)),
    "cabinet": _Piece((0.80, 1.60), (0.40, 0.45), _block(0.90)),
    "chair": _Piece((0.42, 0.45), (0.42, 0.45), _chair),
    "couch": _Piece((1.90, 2.00), (0.65, 0.75), _couch),
    "counter": _Piece((1.60, 2.80), (0.60, 0.62), _block(0.90)),
    "desk": _Piece((1.20, 1.60), (1.05, 1.10), _desk),
    "desk group": _Piece((2.80, 3.20), (2.10, 2.20), _desk_group),
    "desk pair": _Piece((1.40, 1.60), (2.10, 2.20), _desk_group),
    "dining table": _Piece((1.20, 1.80), (1.30, 1.40), _dining),
    "fridge": _Piece((0.60, 0.70), (0.60, 0.65), _block(1.80)),
    "low table": _Piece((0.95, 1.20), (0.50, 0.60), _low_table),
    "meeting table": _Piece((2.00, 3.60), (1.60, 1.80), _dining),
    "nightstand": _Piece((0.40, 0.50), (0.35, 0.40), _block(0.50)),
    "open bed": _Piece((1.40, 1.80), (2.05, 2.10), _open_bed),
    "open chair": _Piece((0.42, 0.45), (0.42, 0.45), _open_chair),
    "open low table": _Piece((0.95, 1.20), (0.50, 0.60), _open_low_table),
    "open shelf": _Piece((0.80, 1.80), (0.30, 0.40), _open_shelf),
    "plant": _Piece((0.35, 0.45), (0.35, 0.45), _block(1.30)),
    "reception": _Piece((1.80, 2.60), (0.70, 0.80), _block(1.10)),
    "seats": _Piece((1.20, 2.20), (0.55, 0.60), _seats),
    "shelf": _Piece((0.80, 1.80), (0.30, 0.40), _block(1.90)),
    "single bed": _Piece((0.90, 1.00), (2.05, 2.10), _bed),
    "sofa": _Piece((1.60, 2.30), (0.85, 0.95), _sofa),
    "table": _Piece((1.00, 1.40), (0.70, 0.80), _table),
    "toilet": _Piece((0.38, 0.40), (0.60, 0.70), _toilet),
    "wardrobe": _Piece((1.20, 2.20), (0.58, 0.62), _block(2.00)),
}
"""All kinds of furniture by name."""


def place(
    kind: str, x: float, y: float, theta: float, width: float | None = None, depth: float | None = None
) -> tuple[Solid, ...]:
    """Place a piece of furniture on a floor.

    Parameters
    ----------
    x, y : float
        Middle of its footprint [m].
    theta : float
        Direction of its back [rad]: pi / 2 for a piece whose back is against the wall of the
        larger y.
    width, depth : float, optional
        Its size [m]; without it the middle of the kind's range.
    """
    if kind not in PIECES:
        raise ValueError(f"no furniture called {kind!r}; there are {', '.join(PIECES)}")
    piece = PIECES[kind]
    width = sum(piece.width) / 2 if width is None else width
    depth = sum(piece.depth) / 2 if depth is None else depth
    cosine, sine = round(math.sin(theta), 9), round(-math.cos(theta), 9)
    turn = np.array([[cosine, -sine], [sine, cosine]])
    solids = []
    for x_low, y_low, x_high, y_high, z_low, z_high in piece.parts(width, depth):
        corners = np.array([(x_low, y_low), (x_high, y_low), (x_high, y_high), (x_low, y_high)]) - (
            width / 2,
            depth / 2,
        )
        solids.append(Solid(np.round(corners @ turn.T + (x, y), 4) + 0.0, z_low, z_high))
    return tuple(solids)


APARTMENT = {
    "living": (
        "sofa",
        "low table",
        "shelf",
        "dining table",
        "cabinet",
        "armchair",
        "shelf",
        "plant",
        "cabinet",
        "chair",
    ),
    "bedroom": (
        "bed",
        "wardrobe",
        "cabinet",
        "nightstand",
        "desk",
        "shelf",
        "armchair",
        "plant",
        "box",
        "shelf",
        "box",
    ),
    "child": ("single bed", "desk", "wardrobe", "shelf", "cabinet", "box", "box", "shelf", "box"),
    "kitchen": ("counter", "fridge", "table", "counter", "cabinet", "chair", "chair", "shelf"),
    "bath": ("bathtub", "toilet", "basin", "cabinet", "box"),
    "store": ("shelf", "box", "shelf", "box", "cabinet", "box"),
    "hall": ("shelf", "cabinet", "bench", "plant"),
}
OFFICE = {
    "office": (
        "desk",
        "shelf",
        "desk",
        "cabinet",
        "wardrobe",
        "desk",
        "plant",
        "shelf",
        "chair",
        "cabinet",
        "box",
        "shelf",
    ),
    "open office": (
        "desk group",
        "desk pair",
        "shelf",
        "desk",
        "cabinet",
        "desk",
        "shelf",
        "wardrobe",
        "plant",
        "cabinet",
        "desk",
    ),
    "meeting": ("meeting table", "cabinet", "shelf", "plant", "chair", "cabinet", "box", "chair"),
    "washroom": ("toilet", "basin", "toilet", "cabinet"),
    "store": ("shelf", "shelf", "box", "cabinet", "box", "shelf"),
    "hall": (
        "seats",
        "plant",
        "cabinet",
        "bench",
        "shelf",
        "cabinet",
        "sofa",
        "bench",
        "plant",
        "seats",
        "shelf",
    ),
}
CORRIDORS = {"hall": ("cabinet", "bench", "shelf", "plant", "box", "cabinet", "shelf", "seats", "box", "bench") * 4}


def _room_wishes(kind: str, areas: NDArray[np.float64], generator: np.random.Generator) -> list[tuple[str, ...]]:
    """List the pieces that each room would like to hold, by label, from its use.

    Parameters
    ----------
    areas : (rooms,) float64
        Areas of the rooms [m²]; their use follows from these.
    """
    if kind == "corridors":
        return [CORRIDORS["hall"]]
    if kind == "office":
        uses = ["hall"] + [_office_use(area, generator.random()) for area in areas[1:]]
        return [OFFICE[use] * (3 if use == "hall" else 1) for use in uses]
    rooms = [int(room) for room in np.argsort(areas[1:], kind="stable") + 1]
    uses = ["hall"] + ["child"] * len(rooms)
    for room in rooms:
        uses[room] = "store" if areas[room] < 5.5 else "child" if areas[room] < 11.0 else "bedroom"
    uses[rooms[0]] = "bath"
    if len(rooms) > 3:
        uses[rooms[1]] = "bath" if areas[rooms[1]] < 4.5 and len(rooms) > 5 else "kitchen"
        uses[rooms[2]] = "kitchen" if uses[rooms[1]] == "bath" else uses[rooms[2]]
    if len(rooms) > 1:
        uses[rooms[-1]] = "living"
    return [APARTMENT[use] for use in uses]


def _office_use(area: float, draw: float) -> str:
    if area < 7.0:
        return "washroom" if draw < 0.5 else "store"
    if area < 16.0:
        return "office" if draw < 0.85 else "store"
    return "meeting" if draw < 0.3 else "office" if area < 22.0 else "open office"


PASSAGE = 0.75
"""Clear width before a piece and between two separate pieces [m].

Pieces are separate if they do not stand side by side.
"""

DOOR_DEPTH = 0.95
"""Depth of the clear rectangle at both sides of a door [m]."""

ATTEMPTS = 10
"""Draws of a place for one piece before it is left out."""

FREE = frozenset({"desk group", "desk pair", "dining table", "low table", "meeting table", "table"})
"""Free-standing pieces."""


@dataclass(frozen=True, slots=True)
class Furnished:
    """A piece of furniture in its room: room label, footprint and solids."""

    room: int
    footprint: Rectangle
    solids: tuple[Solid, ...]


class FurniturePlaces:
    """Free positions for furniture: walls by room, and areas that are taken or kept clear.

    Parameters
    ----------
    labels : (rows, columns) int32
        The plan.
    doors : list of Door
        Areas to keep clear.
    wall_thickness : float
        Thickness of the walls between rooms [m].
    """

    def __init__(self, labels: Labels, doors: list[Door], wall_thickness: float) -> None:
        self._labels = labels
        self._half_wall = wall_thickness / 2
        self._walls: dict[int, list[tuple[Boundary, bool]]] = {}
        for boundary in boundaries(labels):
            for room, above in ((boundary.low, False), (boundary.high, True)):
                self._walls.setdefault(room, []).append((boundary, above))
        self._clear: dict[int, list[Rectangle]] = {}
        for door in doors:
            rectangle = door.boundary.rectangle(door.start - 0.1, door.end + 0.1, DOOR_DEPTH, DOOR_DEPTH)
            for room in (door.boundary.low, door.boundary.high):
                self._clear.setdefault(room, []).append(rectangle)
        self._taken: dict[int, list[tuple[Rectangle, Boundary | None]]] = {}
        rows: dict[int, tuple[slice, slice]] = {}
        for room in range(int(labels.max()) + 1):
            inside = labels == room
            row, column = np.flatnonzero(inside.any(axis=1)), np.flatnonzero(inside.any(axis=0))
            if row.size:
                rows[room] = (
                    slice(int(row[0]), int(row[-1]) + 1),
                    slice(int(column[0]), int(column[-1]) + 1),
                )
        self._extent = rows

    def draw(
        self, room: int, name: str, width: float, depth: float, generator: np.random.Generator
    ) -> Furnished | None:
        """Try a few positions for a piece; None if all are occupied."""
        for _ in range(ATTEMPTS):
            wall: Boundary | None = None
            if name in FREE:
                rectangle, theta = self._free(room, width, depth, generator)
            else:
                against = self._against_wall(room, width, depth, generator)
                if against is None:
                    return None
                rectangle, theta, wall = against
            if self._is_free(room, rectangle, wall):
                self._taken.setdefault(room, []).append((rectangle, wall))
                x, y = (rectangle[0] + rectangle[2]) / 2, (rectangle[1] + rectangle[3]) / 2
                return Furnished(room, rectangle, place(name, x, y, theta, width, depth))
        return None

    def _free(self, room: int, width: float, depth: float, generator: np.random.Generator) -> tuple[Rectangle, float]:
        rows, columns = self._extent[room]
        turned = generator.random() < 0.5
        across, along = (depth, width) if turned else (width, depth)
        middle_x, middle_y = (columns.start + columns.stop) * CELL / 2, (rows.start + rows.stop) * CELL / 2
        spare_x = max((columns.stop - columns.start) * CELL - across - 2 * PASSAGE, 0.0)
        spare_y = max((rows.stop - rows.start) * CELL - along - 2 * PASSAGE, 0.0)
        x = _snapped(middle_x - across / 2 + spare_x * generator.uniform(-0.5, 0.5))
        y = _snapped(middle_y - along / 2 + spare_y * generator.uniform(-0.5, 0.5))
        return (x, y, x + across, y + along), 0.0 if turned else math.pi / 2

    def _against_wall(
        self, room: int, width: float, depth: float, generator: np.random.Generator
    ) -> tuple[Rectangle, float, Boundary] | None:
        """Back to a wall, half of the time in a corner of it."""
        walls = [wall for wall in self._walls[room] if wall[0].length >= width + 0.2]
        if not walls:
            return None
        # Longer walls are taken more often: a point is drawn on all of them laid end to end.
        ends = list(accumulate(wall[0].length for wall in walls))
        boundary, above = walls[bisect_left(ends, generator.random() * ends[-1])]
        offset = self._half_wall + 0.02 if boundary.low >= 0 and boundary.high >= 0 else 0.02
        slack = boundary.length - width - 2 * (self._half_wall + 0.02)
        share = min(max(2.0 * generator.random() - 0.5, 0.0), 1.0)
        start = boundary.start + self._half_wall + 0.02 + slack * share
        if above:
            rectangle = boundary.rectangle(start, start + width, -offset, offset + depth)
        else:
            rectangle = boundary.rectangle(start, start + width, offset + depth, -offset)
        side = 1.0 if above else 0.0
        return rectangle, math.pi * side if boundary.vertical else math.pi * (0.5 - side), boundary

    def _is_free(self, room: int, rectangle: Rectangle, wall: Boundary | None) -> bool:
        """Whether a rectangle is free for a piece in a room.

        It is inside the room with a passage before it, off the doors, and beside or well away from all other
        pieces.
        """
        if not self._is_inside(room, _with_passage(rectangle, wall, room, self._half_wall)):
            return False
        if any(_gap(rectangle, clear) <= 0.0 for clear in self._clear.get(room, [])):
            return False
        return all(
            _gap(rectangle, other) >= (0.02 if wall is not None and wall is other_wall else PASSAGE)
            for other, other_wall in self._taken.get(room, [])
        )

    def _is_inside(self, room: int, rectangle: Rectangle) -> bool:
        x_low, y_low, x_high, y_high = rectangle
        if x_low < 0.0 or y_low < 0.0:
            return False
        rows = slice(int(y_low / CELL + 1e-6), math.ceil(y_high / CELL - 1e-6))
        columns = slice(int(x_low / CELL + 1e-6), math.ceil(x_high / CELL - 1e-6))
        if rows.stop > self._labels.shape[0] or columns.stop > self._labels.shape[1]:
            return False
        return bool((self._labels[rows, columns] == room).all())


def _snapped(value: float) -> float:
    return round(value / 0.05) * 0.05


def _with_passage(rectangle: Rectangle, wall: Boundary | None, room: int, half_wall: float) -> Rectangle:
    """Return the footprint and the passage that must lie in the room.

    The passage is before a piece at a wall, and all around a free-standing one.
    """
    x_low, y_low, x_high, y_high = rectangle
    more = PASSAGE + half_wall
    if wall is None:
        return (x_low - more, y_low - more, x_high + more, y_high + more)
    before = wall.low == room
    if wall.vertical:
        return (x_low - more, y_low, x_high, y_high) if before else (x_low, y_low, x_high + more, y_high)
    return (x_low, y_low - more, x_high, y_high) if before else (x_low, y_low, x_high, y_high + more)


def _gap(a: Rectangle, b: Rectangle) -> float:
    """Larger of the distances along x and y between two rectangles [m].

    Negative if they overlap.
    """
    return max(a[0] - b[2], b[0] - a[2], a[1] - b[3], b[1] - a[3])


SMALLEST_M2 = 0.1
"""Furnishing ends when less than this is left to cover [m²]."""

FULL = 4
"""Pieces in a row without a place after which a room counts as full."""


def furnish(
    kind: str,
    labels: Labels,
    doors: list[Door],
    clutter: float,
    wall_thickness: float,
    generator: np.random.Generator,
) -> list[Furnished]:
    """Furniture for all rooms of a plan, main pieces first.

    Parameters
    ----------
    labels : (rows, columns) int32
        The plan.
    wall_thickness : float
        Thickness of the walls between rooms [m].
    """
    areas = room_areas(labels)
    wishes = _room_wishes(kind, areas, generator)
    places = FurniturePlaces(labels, doors, wall_thickness)
    budget = clutter * float(areas.sum())
    placed: list[Furnished] = []
    misses = [0] * len(wishes)
    for turn in range(2 * max(len(wish) for wish in wishes)):
        for room in generator.permutation(len(wishes)):
            if areas[room] == 0.0 or budget < SMALLEST_M2 or misses[room] == FULL:
                continue
            first, rest = wishes[room][: len(wishes[room]) // 2], wishes[room][len(wishes[room]) // 2 :]
            name = first[turn] if turn < len(first) else rest[(turn - len(first)) % len(rest)]
            width, depth = (
                round(generator.uniform(*span) / 0.05) * 0.05 for span in (PIECES[name].width, PIECES[name].depth)
            )
            if width * depth / 2 > budget:
                continue
            found = places.draw(int(room), name, width, depth, generator)
            misses[room] = 0 if found is not None else misses[room] + 1
            if found is not None:
                placed.append(found)
                budget -= width * depth
    return placed
