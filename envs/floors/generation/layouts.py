"""Layouts: plans of apartments, offices and corridor networks, drawn by seed.

Every function here paints rooms into a plan whose inner extent follows from the wanted area; room 0 is the
hall.
"""

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.floors.generation.plans import HALL, OUTSIDE, Labels, cells, metres

LatticeEdge = tuple[tuple[int, int], tuple[int, int]]

LOBBY_CHANCE = 0.12
"""Share of office rooms that are open bays of the corridor.

Such bays are waiting areas, kitchenettes and lift lobbies.
"""


@dataclass(frozen=True, slots=True)
class Proportions:
    """What a layout is drawn to.

    Attributes
    ----------
    area_m2 : float
        Area between the outer walls [m²].
    corridor_width : float
        Width of hall or corridors between the middles of their walls [m].
    room_size : (float, float)
        Smallest and largest frontage of a room [m].
    loops : float
        Share of possible further connections of a corridor network, 0 to 1.
    """

    area_m2: float
    corridor_width: float
    room_size: tuple[float, float]
    loops: float


def apartment_layout(proportions: Proportions, generator: np.random.Generator) -> Labels:
    """Rooms at both sides of a hall, a living room across its end.

    Baths and store rooms cut out of larger rooms.

    The service side of the hall (bath, kitchen, store) is shallow with narrow rooms, the other side is deep
    (bedrooms).
    """
    area, hall = proportions.area_m2, proportions.corridor_width
    size = min(max(math.sqrt(area / 75.0), 0.75), 1.35)
    service = generator.uniform(2.1, 2.6) * min(size, 1.15)
    depth = generator.uniform(3.3, 4.0) * size
    height = service + hall + depth
    width = area / height
    living = min(max(generator.uniform(0.3, 0.42) * width, 3.0), 0.6 * width)
    master = generator.uniform(2.9, 3.6) if width - living > 7.0 and generator.random() < 0.6 else 0.0
    labels: Labels = np.full((cells(height), cells(width)), HALL, dtype=np.int32)
    left, right, low, high = cells(master), cells(width - living), cells(service), cells(service + hall)
    room = 1
    narrow, wide = proportions.room_size
    for rows, least, most in (
        (slice(0, low), 0.75 * narrow, 0.65 * wide),
        (slice(high, None), 1.1 * narrow, wide),
    ):
        edges = _split(right - left, cells(least), cells(most), generator)
        for start, end in pairwise(edges):
            labels[rows, left + start : left + end] = room
            room += 1
    labels[:, right:] = room
    if master:
        labels[:, :left] = room + 1
    _carve_rooms(labels, chance=0.6, least_m2=13.0, generator=generator)
    if generator.random() < 0.4:
        deep, broad = cells(generator.uniform(1.0, 1.8)), cells(generator.uniform(0.35, 0.5) * living)
        labels[
            (slice(0, deep) if generator.random() < 0.5 else slice(labels.shape[0] - deep, None)),
            labels.shape[1] - broad :,
        ] = OUTSIDE
    return _turned(labels, generator)


def office_layout(proportions: Proportions, generator: np.random.Generator) -> Labels:
    """Draw corridors with rooms at both sides.

    There is one corridor, or two joined by cross corridors around blocks of rooms.
    """
    area, corridor = proportions.area_m2, proportions.corridor_width
    depths = [generator.uniform(3.6, 5.4) for _ in range(2)]
    core = generator.uniform(4.0, 5.6) if generator.random() < 0.5 else generator.uniform(7.4, 9.6)
    double = generator.random() < np.interp(area, (220.0, 420.0), (0.0, 0.9))
    height = sum(depths) + (2 * corridor + core if double else corridor)
    width = area / height
    labels: Labels = np.full((cells(height), cells(width)), HALL, dtype=np.int32)
    bottom, top = cells(depths[0]), cells(height - depths[1])
    room = 1
    room = _row_of_rooms(labels, slice(0, bottom), slice(None), room, proportions, generator)
    room = _row_of_rooms(labels, slice(top, None), slice(None), room, proportions, generator)
    if double:
        rows = slice(bottom + cells(corridor), top - cells(corridor))
        for columns in _blocks(labels.shape[1], cells(corridor), generator):
            if core > 7.0:
                middle = rows.start + cells(core * generator.uniform(0.42, 0.58))
                room = _row_of_rooms(labels, slice(rows.start, middle), columns, room, proportions, generator)
                room = _row_of_rooms(labels, slice(middle, rows.stop), columns, room, proportions, generator)
            else:
                room = _row_of_rooms(labels, rows, columns, room, proportions, generator)
    _carve_rooms(labels, chance=0.2, least_m2=16.0, generator=generator)
    return _turned(_without_gaps(labels), generator)


def corridor_layout(proportions: Proportions, generator: np.random.Generator) -> Labels:
    """Draw corridors along the edges of an irregular lattice.

    The edges are a tree and a share of the others; some crossings are widened to halls.
    """
    corridor = proportions.corridor_width
    spacing = max(generator.uniform(4.5, 6.5), 2.2 * corridor)
    aspect = generator.uniform(1.0, 1.8)
    crossings = proportions.area_m2 / (spacing * corridor * (1.0 + 0.7 * proportions.loops))
    down = max(2, round(math.sqrt(crossings / aspect)))
    across = max(2, round(crossings / down))
    edges = _lattice_edges(down, across, proportions.loops, generator)
    halls = generator.random((down, across)) < 0.2
    # The area is that of crossings, of halls around some of them, and of corridors whose lengths are scaled
    # to what is left.
    steps_y, steps_x = generator.uniform(0.5, 1.5, down - 1), generator.uniform(0.5, 1.5, across - 1)
    steps = sum(float(steps_x[j] if i == k else steps_y[i]) for (i, j), (k, _) in edges)
    left = proportions.area_m2 - down * across * corridor**2 - 5.0 * float(halls.sum())
    x, y = (_crossings(part * max(left / (corridor * steps), 1.2), corridor) for part in (steps_x, steps_y))
    wide = cells(corridor)
    labels: Labels = np.full((y[-1] + wide, x[-1] + wide), OUTSIDE, dtype=np.int32)
    for (i, j), (k, m) in edges:
        labels[y[i] : y[k] + wide, x[j] : x[m] + wide] = HALL
    for i, j in np.argwhere(halls):
        more = generator.uniform(0.8, 1.6)
        low, high = _widened(y, int(i), wide, more)
        left_edge, right_edge = _widened(x, int(j), wide, more)
        labels[low:high, left_edge:right_edge] = HALL
    return labels


def _split(length: int, least: int, most: int, generator: np.random.Generator) -> list[int]:
    """Edges of pieces of `least` to about `most` cells that fill a length."""
    wanted = round(length / generator.uniform(least, most))
    count = max(1, min(max(wanted, math.ceil(length / most)), length // least))
    weights = generator.uniform(0.15, 1.0, count)
    widths = least + (length - count * least) * weights / weights.sum()
    edges = np.rint(np.concatenate([[0.0], np.cumsum(widths)])).astype(int)
    return [int(edge) for edge in edges[:-1]] + [length]


def _row_of_rooms(
    labels: Labels,
    rows: slice,
    columns: slice,
    room: int,
    proportions: Proportions,
    generator: np.random.Generator,
) -> int:
    """Paint a row of rooms, some left to the corridor as open bays.

    Returns the next free label.
    """
    first, last, _ = columns.indices(labels.shape[1])
    edges = _split(last - first, cells(proportions.room_size[0]), cells(proportions.room_size[1]), generator)
    bays = generator.random(len(edges) - 1) < LOBBY_CHANCE
    for start, end, bay in zip(edges[:-1], edges[1:], bays, strict=True):
        if not (bay and end - start < cells(6.0)):
            labels[rows, first + start : first + end] = room
            room += 1
    return room


def _blocks(length: int, corridor: int, generator: np.random.Generator) -> list[slice]:
    """Blocks of rooms between one to three cross corridors, which may lie at the ends."""
    most = 1 + (length > cells(16.0)) + (length > cells(30.0))
    count = int(generator.integers(1, most + 1))
    if count == 1:
        middles = [generator.uniform(0.3, 0.7)]
    else:
        inset = 0.0 if generator.random() < 0.35 else generator.uniform(0.16, 0.24)
        middles = list(np.linspace(inset, 1.0 - inset, count))
    starts = [round(m * (length - corridor)) for m in middles]
    edges = [0, *(edge for start in starts for edge in (start, start + corridor)), length]
    pairs = zip(edges[::2], edges[1::2], strict=True)
    return [slice(low, high) for low, high in pairs if high - low >= cells(2.0)]


def _carve_rooms(labels: Labels, chance: float, least_m2: float, generator: np.random.Generator) -> None:
    """Cut a small room (bath, store) out of the hall-side corner of larger rooms.

    The larger rooms become L-shaped.
    """
    for room in range(1, int(labels.max()) + 1):
        draw, side = generator.random(), generator.random() < 0.5
        rows, columns = np.nonzero(labels == room)
        if rows.size * metres(1) ** 2 < least_m2 or draw > chance:
            continue
        low, high, left, right = (
            int(rows.min()),
            int(rows.max()) + 1,
            int(columns.min()),
            int(columns.max()) + 1,
        )
        deep, broad = cells(generator.uniform(1.8, 2.3)), cells(generator.uniform(1.6, 2.1))
        if high - low < deep + cells(1.4) or right - left < broad + cells(1.6):
            continue
        across = slice(left, left + broad) if side else slice(right - broad, right)
        if low > 0 and (labels[low - 1, across] == HALL).all():
            labels[low : low + deep, across] = labels.max() + 1
        elif high < labels.shape[0] and (labels[high, across] == HALL).all():
            labels[high - deep : high, across] = labels.max() + 1


def _crossings(gaps: NDArray[np.float64], corridor: float) -> list[int]:
    """Return the lower edges of parallel corridors with blocks between them.

    The blocks have the given depths, 1.2 m at least.
    """
    return [cells(edge) for edge in np.concatenate([[0.0], np.cumsum(np.maximum(gaps, 1.2) + corridor)])]


def _widened(edges: list[int], k: int, wide: int, more: float) -> tuple[int, int]:
    """Return the range of a hall on the k-th corridor.

    Blocks between the hall and its neighbours stay at least 0.8 m thick.
    """
    below = edges[k] - edges[k - 1] - wide if k > 0 else 0
    above = edges[k + 1] - edges[k] - wide if k + 1 < len(edges) else 0
    low, high = (max(min(cells(more), gap // 2 - cells(0.4)), 0) for gap in (below, above))
    return edges[k] - low, edges[k] + wide + high


def _lattice_edges(down: int, across: int, loops: float, generator: np.random.Generator) -> list[LatticeEdge]:
    """Draw a random spanning tree of a lattice and a share of the edges beyond it."""
    edges = [((i, j), (i, j + 1)) for i in range(down) for j in range(across - 1)]
    edges += [((i, j), (i + 1, j)) for i in range(down - 1) for j in range(across)]
    group = {(i, j): i * across + j for i in range(down) for j in range(across)}
    tree: list[LatticeEdge] = []
    further: list[LatticeEdge] = []
    for k in generator.permutation(len(edges)):
        a, b = group[edges[k][0]], group[edges[k][1]]
        (further if a == b else tree).append(edges[k])
        if a != b:
            group = {node: a if g == b else g for node, g in group.items()}
    return tree + further[: round(loops * len(further))]


def _without_gaps(labels: Labels) -> Labels:
    """Give rooms consecutive labels, the hall first."""
    _, packed = np.unique(labels, return_inverse=True)
    return packed.reshape(labels.shape).astype(np.int32) + min(int(labels.min()), 0)


def _turned(labels: Labels, generator: np.random.Generator) -> Labels:
    """One of the eight mirrored and turned versions."""
    flip_x, flip_y, swap = generator.random(3) < 0.5
    labels = labels[:, ::-1] if flip_x else labels
    labels = labels[::-1] if flip_y else labels
    return np.ascontiguousarray(labels.T if swap else labels)
