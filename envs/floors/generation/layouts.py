"""Layouts of generated buildings: their plans of rooms, corridors and doors."""

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

CELL = 0.1
"""Side of a lattice cell [m]."""

OUTSIDE = -1
"""Label outside rooms."""

HALL = 0
"""Label of the space from which the rooms are reached: hall or corridors."""

JAMB = 0.15
"""Minimum distance of a door from the end of its wall [m]."""

SMALL_ROOM_M2 = 5.0
"""Rooms below this area have one door only: people do not walk through a bathroom."""

Labels = NDArray[np.int32]
Rectangle = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class Boundary:
    """A straight piece of the line where two rooms meet.

    Attributes
    ----------
    vertical : bool
        True if it runs along y.
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
    """Length of a number of lattice cells [m], without the dust of binary fractions."""
    return round(float(count) * CELL, 6)


def boundaries(labels: Labels) -> list[Boundary]:
    """Return all maximal straight boundaries between different labels.

    Boundaries with the outside are included.

    Parameters
    ----------
    labels : (rows, columns) int32
        The plan; its outer ring must be outside.
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


def choose_doors(labels: Labels, door_width: float, loops: float, generator: np.random.Generator) -> list[Door] | None:
    """Choose doors that join all rooms, and a share of the further possible ones.

    Rooms are joined from the hall if possible.

    Parameters
    ----------
    labels : (rows, columns) int32
        The plan.
    door_width : float
        Clear width of every door [m].
    """
    areas = room_areas(labels)
    candidates = [b for b in boundaries(labels) if b.low >= 0 and b.high >= 0 and b.length >= door_width + 2 * JAMB]
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

    Boundaries on one line are one wall, and walls reach half their thickness beyond their ends, so that corners
    close.
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
            rectangles += [line.rectangle(edges[k], edges[k + 1], half, half) for k in range(0, len(edges), 2)]
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
            rectangles.append((metres(first), metres(open_runs.pop((first, last))), metres(last), metres(row)))
        for run in sorted(runs - open_runs.keys()):
            open_runs[run] = row
    return rectangles


LatticeEdge = tuple[tuple[int, int], tuple[int, int]]

LOBBY_CHANCE = 0.12
"""Share of office rooms that are open bays of the corridor.

Such bays are waiting areas, kitchenettes and lift lobbies.
"""


@dataclass(frozen=True, slots=True)
class Proportions:
    """Parameters of a layout.

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
    for rows, minimum, maximum in (
        (slice(0, low), 0.75 * narrow, 0.65 * wide),
        (slice(high, None), 1.1 * narrow, wide),
    ):
        edges = _split(right - left, cells(minimum), cells(maximum), generator)
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


def _split(length: int, minimum: int, maximum: int, generator: np.random.Generator) -> list[int]:
    """Edges of pieces of `least` to about `most` cells that fill a length."""
    wanted = round(length / generator.uniform(minimum, maximum))
    count = max(1, min(max(wanted, math.ceil(length / maximum)), length // minimum))
    weights = generator.uniform(0.15, 1.0, count)
    widths = minimum + (length - count * minimum) * weights / weights.sum()
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
    maximum = 1 + (length > cells(16.0)) + (length > cells(30.0))
    count = int(generator.integers(1, maximum + 1))
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
