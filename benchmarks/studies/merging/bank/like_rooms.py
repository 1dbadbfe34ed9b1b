"""Buildings in which rooms look alike.

A corridor has equal rooms at both sides, furnished alike but for one piece.
"""

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.floors.floor import Floor, Solid

Box = tuple[float, float, float, float]
"""x_low, y_low, x_high, y_high [m]."""

WALL, DOOR = 0.1, 0.9
SLOTS = 4
"""Places of the piece by which rooms differ, the last of them for none."""


def like_rooms(seed: int) -> Floor:
    """Return a corridor with rooms of one size and furniture.

    Rooms differ by where one piece stands; some do not differ.

    Parameters
    ----------
    seed : int
        Of all draws.

    Returns
    -------
    Floor
        With a start in the middle of each of three rooms.
    """
    generator = np.random.default_rng(seed)
    width, depth = (round(float(generator.uniform(*span)), 1) for span in ((3.0, 3.8), (3.4, 4.4)))
    corridor = round(float(generator.uniform(1.6, 2.2)), 1)
    rooms = int(generator.integers(3, 6))
    furniture = _furniture(width, depth, generator)
    choices = generator.integers(0, SLOTS, 2 * rooms)
    boxes = _walls(rooms, width, depth, corridor)
    for index, slot in enumerate(choices.tolist()):
        pieces = [*furniture[:-SLOTS], furniture[len(furniture) - SLOTS + slot]]
        boxes += [
            _placed(piece, index, rooms, width, depth, corridor) for piece in pieces if piece[2] > piece[0]
        ]
    bounds = (0.0, 0.0, rooms * width + 2 * WALL, 2 * depth + corridor + 2 * WALL)
    solids = tuple(Solid(np.array([(a, b), (c, b), (c, d), (a, d)], np.float64)) for a, b, c, d in boxes)
    return Floor(
        f"like_rooms:{seed}", bounds, solids, starts=_starts(rooms, width, depth, corridor, generator)
    )


def _furniture(width: float, depth: float, generator: np.random.Generator) -> list[Box]:
    """Return the pieces of every room, then those of which each room has one.

    X along the corridor, y from it, in a room's frame.
    """
    bed, desk, long = (
        round(float(generator.uniform(*span)), 2) for span in ((1.8, 2.1), (1.0, 1.4), (1.1, 1.4))
    )
    common = [
        (WALL / 2, depth - bed, WALL / 2 + 0.9, depth),
        (width - WALL / 2 - desk, depth - 0.6, width - WALL / 2, depth),
    ]
    own = [
        (WALL / 2, 0.7, WALL / 2 + 0.45, min(0.7 + long, depth - bed - 0.1)),
        (width - WALL / 2 - 0.4, 0.9, width - WALL / 2, 0.9 + long),
        (width / 2 - 0.35, depth - 0.5, width / 2 + 0.25, depth),
        (0.0, 0.0, 0.0, 0.0),
    ]
    return common + own


def _placed(piece: Box, index: int, rooms: int, width: float, depth: float, corridor: float) -> Box:
    """Return a piece of a room in the floor's frame.

    Rooms of the lower side are turned by half a turn.
    """
    column, is_upper = index % rooms, index >= rooms
    x_low, y_low, x_high, y_high = piece
    left = WALL + column * width
    if is_upper:
        low = WALL + depth + corridor
        return left + x_low, low + y_low, left + x_high, low + y_high
    right, high = left + width, WALL + depth
    return right - x_high, high - y_high, right - x_low, high - y_low


def _walls(rooms: int, width: float, depth: float, corridor: float) -> list[Box]:
    length, height = rooms * width + 2 * WALL, 2 * depth + corridor + 2 * WALL
    boxes = [
        (0.0, 0.0, length, WALL),
        (0.0, height - WALL, length, height),
        (0.0, 0.0, WALL, height),
        (length - WALL, 0.0, length, height),
    ]
    for low in (WALL + depth - WALL, WALL + depth + corridor):
        # One wall along the corridor, with a door in the middle of each room.
        edges = [0.0]
        for room in range(rooms):
            middle = WALL + (room + 0.5) * width
            edges += [middle - DOOR / 2, middle + DOOR / 2]
        edges.append(length)
        boxes += [(edges[k], low, edges[k + 1], low + WALL) for k in range(0, len(edges), 2)]
    for room in range(1, rooms):
        x = WALL + room * width - WALL / 2
        boxes += [(x, 0.0, x + WALL, WALL + depth), (x, WALL + depth + corridor, x + WALL, height)]
    return boxes


def _starts(
    rooms: int, width: float, depth: float, corridor: float, generator: np.random.Generator
) -> NDArray[np.float64]:
    chosen = generator.choice(2 * rooms, 3, replace=False)
    places = [
        (
            WALL + (room % rooms + 0.5) * width,
            WALL + 0.5 * depth + (depth + corridor if room >= rooms else 0.0),
        )
        for room in chosen.tolist()
    ]
    return np.asarray(np.round(np.column_stack([places, generator.uniform(-np.pi, np.pi, 3)]), 4), np.float64)
