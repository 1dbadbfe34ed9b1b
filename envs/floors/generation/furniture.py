"""Furniture: pieces as solids with heights.

A laser thus sees the legs of a table, and a tall body meets its top.

A piece is described in its own frame: x to the right of who stands before it, y from its front (0) to its
back (depth), which stands against a wall. Seats and low tables are closed down to the floor: what a low robot
(below 0.6 m) would touch, a laser at 0.3 m sees; table tops, desks and basins meet taller bodies only. Pieces
called open stand on legs or feet, as most real ones do: what is above them, a planar laser misses. Parts are
boxes ``(x_low, y_low, x_high, y_high, z_low, z_high)``.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from lidarium.envs.floors.floor import Solid

Box = tuple[float, float, float, float, float, float]


@dataclass(frozen=True, slots=True)
class Piece:
    """A kind of furniture.

    Attributes
    ----------
    width, depth : (float, float)
        Smallest and largest size [m]; drawn floors take the middle unless they say otherwise.
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


PIECES: dict[str, Piece] = {
    "armchair": Piece((0.75, 0.90), (0.75, 0.85), _sofa),
    "basin": Piece((0.50, 0.80), (0.40, 0.48), _basin),
    "bathtub": Piece((1.60, 1.70), (0.70, 0.80), _block(0.57)),
    "bed": Piece((1.40, 1.80), (2.05, 2.10), _bed),
    "bench": Piece((1.00, 1.60), (0.35, 0.40), _bench),
    "box": Piece((0.40, 0.80), (0.40, 0.60), _block(0.60)),
    "cabinet": Piece((0.80, 1.60), (0.40, 0.45), _block(0.90)),
    "chair": Piece((0.42, 0.45), (0.42, 0.45), _chair),
    "couch": Piece((1.90, 2.00), (0.65, 0.75), _couch),
    "counter": Piece((1.60, 2.80), (0.60, 0.62), _block(0.90)),
    "desk": Piece((1.20, 1.60), (1.05, 1.10), _desk),
    "desk group": Piece((2.80, 3.20), (2.10, 2.20), _desk_group),
    "desk pair": Piece((1.40, 1.60), (2.10, 2.20), _desk_group),
    "dining table": Piece((1.20, 1.80), (1.30, 1.40), _dining),
    "fridge": Piece((0.60, 0.70), (0.60, 0.65), _block(1.80)),
    "low table": Piece((0.95, 1.20), (0.50, 0.60), _low_table),
    "meeting table": Piece((2.00, 3.60), (1.60, 1.80), _dining),
    "nightstand": Piece((0.40, 0.50), (0.35, 0.40), _block(0.50)),
    "open bed": Piece((1.40, 1.80), (2.05, 2.10), _open_bed),
    "open chair": Piece((0.42, 0.45), (0.42, 0.45), _open_chair),
    "open low table": Piece((0.95, 1.20), (0.50, 0.60), _open_low_table),
    "open shelf": Piece((0.80, 1.80), (0.30, 0.40), _open_shelf),
    "plant": Piece((0.35, 0.45), (0.35, 0.45), _block(1.30)),
    "reception": Piece((1.80, 2.60), (0.70, 0.80), _block(1.10)),
    "seats": Piece((1.20, 2.20), (0.55, 0.60), _seats),
    "shelf": Piece((0.80, 1.80), (0.30, 0.40), _block(1.90)),
    "single bed": Piece((0.90, 1.00), (2.05, 2.10), _bed),
    "sofa": Piece((1.60, 2.30), (0.85, 0.95), _sofa),
    "table": Piece((1.00, 1.40), (0.70, 0.80), _table),
    "toilet": Piece((0.38, 0.40), (0.60, 0.70), _toilet),
    "wardrobe": Piece((1.20, 2.20), (0.58, 0.62), _block(2.00)),
}
"""All kinds of furniture by name."""


def place(
    kind: str, x: float, y: float, theta: float, width: float | None = None, depth: float | None = None
) -> tuple[Solid, ...]:
    """Place a piece of furniture on a floor.

    Parameters
    ----------
    kind : str
        A name in `PIECES`.
    x, y : float
        Middle of its footprint [m].
    theta : float
        Direction of its back [rad]: pi / 2 for a piece whose back is against the wall of the
        larger y.
    width, depth : float, optional
        Its size [m]; without it the middle of the kind's range.

    Returns
    -------
    tuple of Solid

    Raises
    ------
    ValueError
        If there is no such kind.
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
