"""Corners of occupancy maps, from the eight neighbours of a free cell.

One lookup decides whether the cell lies in a corner, and the direction of its opening.

The neighbours' occupancy is a code of eight bits; bit i is the cell at 45 i degrees, counter-clockwise from
+x. Sixteen of the 256 codes are concave corners and jogs of walls as seen from free space; convex corners
have too few occupied neighbours and do not fire.
"""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated

import cv2
import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.bounds import Counted, Distance, check_settings, shown, within
from lidarium.mapping.grids.occupancy import FREE, OCCUPIED, UNKNOWN
from lidarium.mapping.kernels.compilation import Array, kernel


@lru_cache
def _orientation_table(rule: str = "table", neighbours: tuple[int, ...] = (4, 5, 6)) -> NDArray[np.uint8]:
    """Return the opening angle of each of the 256 codes plus one, shape (256,).

    Angles are in units of ``STEP``; 0 if the code is no corner.
    """
    table = np.zeros(256, np.uint8)
    for code in range(256):
        opening = _literal_opening(code) if rule == "literal" else _opening(code)
        if opening is not None and code.bit_count() in neighbours:
            table[code] = opening + 1
    table.setflags(write=False)
    return table


def _opening(code: int) -> int | None:
    """Return the direction in which a code opens [STEP], None for no corner.

    None if its free cells are not the single run that a corner has.
    """
    free = [i for i in range(8) if not code >> i & 1]
    if len(free) not in (1, 2, 3, 4):
        return None
    if len(free) == 4:
        # An L without its corner cell: that diagonal is free, and opposite lies a run of three free cells
        # around a diagonal.
        middles = [i for i in free if i % 2 == 1 and {(i - 1) % 8, (i + 1) % 8, (i + 4) % 8} < set(free)]
        return 2 * middles[0] if len(middles) == 1 else None
    starts = [i for i in free if (i - 1) % 8 not in free]
    if len(starts) != 1 or (len(free) == 3 and starts[0] % 2 == 1):
        return None
    return (2 * starts[0] + len(free) - 1) % 16


def _literal_opening(code: int) -> int | None:
    """Return the opening direction of a code by the printed parity rules [STEP].

    The rules are as they were printed, modulus 2.
    """
    a, p, b, q, a_, p_, b_, q_ = (code >> i & 1 for i in range(8))
    r = code.bit_count()
    direct, main, other = a + a_ + b + b_, p + p_, q + q_
    free = [i for i in range(8) if not code >> i & 1]
    if r == 4:
        is_corner = (a + p + b) % 2 == 0 and direct == 2 and (p + b + q) + (p_ + b_ + q_) == 3 and main != other
        return _opening(code) if is_corner else None
    if r == 5 and direct == 2 and (p + b + q + p + a + q_) % 2 == 0:
        return 2 * next(i for i in free if i % 2 == 1)
    if r == 6 and direct == 3 and main + other == 3:
        first, second = free
        return (first + second + (8 if second - first > 4 else 0)) % 16
    return _opening(code) if r == 7 else None


STEP = math.pi / 8.0
"""Corners open in multiples of this angle [rad]."""


RULES = ("table", "literal")


_WORD = 8


# By number of occupied neighbours.
_PRIORITY = np.array([4, 4, 4, 4, 1, 0, 2, 3, 4])


_DIRECT, _DIAGONAL = 0b01010101, 0b10101010


@dataclass(frozen=True, slots=True, kw_only=True)
class CornerSettings:
    """Which neighbourhoods are corners.

    Attributes
    ----------
    neighbours : tuple of int
        Numbers of occupied neighbours that are examined, any of 4 (corner without its corner cell), 5 (whole
        corner), 6 (jog of a wall) and 7 (dead end one cell wide).
    rule : str
        ``table``: the sixteen codes that are alike in all directions (and eight with 7 neighbours);
        ``literal``: the printed rules of parity, with codes that hold two or three separate openings.
    separation_m : float, default 0.1
        Of corners nearer than this only the best is kept: 5 neighbours before 4, 6 and 7 [m]; 0 keeps all.
    limit : int, default 96
        Maximum number of corners, the best and among equals the most evenly spread; 0 keeps all.
    free_above, occupied_below : int, default 200, 55
        Greys of free and of occupied cells, exclusive; greys between are unknown.
    """

    neighbours: tuple[int, ...] = (4, 5, 6)
    rule: str = "table"
    separation_m: Distance = 0.1
    limit: Counted = 96
    free_above: Annotated[int, within(1, 254)] = 200
    occupied_below: Annotated[int, within(1, 254)] = 55

    def __post_init__(self) -> None:
        check_settings(self, "corners")
        is_list = isinstance(self.neighbours, tuple | list) and len(self.neighbours) > 0
        if not is_list or not all(each in (4, 5, 6, 7) for each in self.neighbours):
            raise ValueError(f"neighbours of corners are {shown(self.neighbours)}; want some of 4, 5, 6 and 7")
        object.__setattr__(self, "neighbours", tuple(self.neighbours))
        if self.rule not in RULES:
            raise ValueError(f"rule of corners is {self.rule!r}; want one of {', '.join(RULES)}")
        if not self.occupied_below <= self.free_above:
            raise ValueError(
                f"greys are {self.occupied_below} and {self.free_above}; want 0 < occupied_below <= free_above < 255"
            )


@dataclass(frozen=True, slots=True, eq=False)
class Corners:
    """Corners of a map.

    Attributes
    ----------
    cells : (n, 2) int64
        Column and row.
    points : (n, 2) float64
        Centres of these cells in the map's frame [m].
    angles : (n,) float64
        Direction in which each opens [rad], in [0, 2 pi).
    neighbours : (n,) int64
        Number of occupied neighbours.
    """

    cells: NDArray[np.int64]
    points: NDArray[np.float64]
    angles: NDArray[np.float64]
    neighbours: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.cells)

    def take(self, indices: NDArray[np.int64]) -> "Corners":
        """Return some of them."""
        return Corners(self.cells[indices], self.points[indices], self.angles[indices], self.neighbours[indices])


def detect_corners(levels: NDArray[np.uint8], resolution: float, settings: CornerSettings | None = None) -> Corners:
    """Find the corners of a map.

    Parameters
    ----------
    levels : (rows, columns) uint8
        Occupancy, dark is occupied; row 0 at the lowest y. Greys are cut into three levels.
    resolution : float
        Side of a cell [m].
    settings : CornerSettings or None
        Which neighbourhoods are corners.
    """
    settings = settings or CornerSettings()
    rows, columns = levels.shape
    # Cells are read in words of eight; a border of unknown cells lets every word have neighbours.
    right = -columns % _WORD + _WORD
    padded = cv2.copyMakeBorder(levels, 1, 1, _WORD, right, cv2.BORDER_CONSTANT, value=UNKNOWN)
    three = (
        padded
        if _is_three_level(padded.view(np.uint64))
        else cv2.LUT(padded, _levels_of_greys(settings.occupied_below, settings.free_above))
    )
    table = _orientation_table(settings.rule, settings.neighbours)
    found = np.empty((levels.size // 2 + 1, 3), np.int32)
    count = _find_corners(three.view(np.uint64), rows, columns, table, found)
    cells = found[:count, :2].astype(np.int64)
    codes = found[:count, 2]
    points = np.asarray((cells + 0.5) * resolution, np.float64)
    angles = (table[codes].astype(np.float64) - 1.0) * STEP
    corners = Corners(cells, points, angles, np.bitwise_count(codes.astype(np.uint8)).astype(np.int64))
    corners = _separated(corners, settings.separation_m)
    return _limited(corners, settings.limit)


@lru_cache
def _levels_of_greys(occupied_below: int, free_above: int) -> NDArray[np.uint8]:
    greys = np.arange(256)
    return np.where(greys < occupied_below, OCCUPIED, np.where(greys > free_above, FREE, UNKNOWN)).astype(np.uint8)


@kernel
def _is_three_level(words: Array) -> bool:
    """Return whether the bytes of words are the three levels alone.

    The levels are 0x00, 0x7f and 0xff.

    These are the bytes whose seven low bits are the same, but for 0x80.
    """
    same, ones = np.uint64(0x3F3F3F3F3F3F3F3F), np.uint64(0x0101010101010101)
    others = np.uint64(0)
    for row in range(words.shape[0]):
        for column in range(words.shape[1]):
            word = words[row, column]
            others |= ((word ^ (word >> np.uint64(1))) & same) | ((word >> np.uint64(7)) & ~word & ones)
    return bool(others == np.uint64(0))


@kernel(forceinline=True)
def _gathered(word: np.uint64) -> np.int64:
    """Return the lowest bits of the eight bytes of a word as one byte.

    The first cell's bit is the lowest.
    """
    return np.int64(((word & np.uint64(0x0101010101010101)) * np.uint64(0x0102040810204080)) >> np.uint64(56))


@kernel(forceinline=True)
def _occupied_around(words: Array, row: int, word: int) -> np.int64:
    """Return which cells of a word and its two neighbours are occupied.

    Bit 0 is the last cell of the word before, bit 9 the first of the word after.
    """
    before, after = words[row, word - 1] >> np.uint64(56), words[row, word + 1]
    here = _gathered(~words[row, word])
    around: np.int64 = np.int64(~before & np.uint64(1)) | here << 1 | np.int64(~after & np.uint64(1)) << 9
    return around


@kernel
def _find_corners(words: Array, rows: int, columns: int, table: Array, found: Array) -> int:
    """Write column, row and code of each corner to ``found`` and return their number.

    ``words`` is the map in words of eight cells, with a border of one row and one word of columns. Of a
    cell's byte the lowest bit says whether it is occupied (0), the highest whether it is free (1). A corner
    has four occupied neighbours or more, of which at most three lie in the next word: if a word and those
    above and below have none, no cell of it is a corner.
    """
    ones = np.uint64(0x0101010101010101)
    count, limit = 0, found.shape[0]
    for row in range(2, rows):
        for word in range(1, words.shape[1] - 1):
            if ~(words[row - 1, word] & words[row, word] & words[row + 1, word]) & ones == np.uint64(0):
                continue
            is_free = _gathered(words[row, word] >> np.uint64(7))
            if is_free == 0:
                continue
            below, here, above = (
                _occupied_around(words, row - 1, word),
                _occupied_around(words, row, word),
                _occupied_around(words, row + 1, word),
            )
            for position in range(_WORD):
                column = word * _WORD + position
                if not is_free >> position & 1 or column == _WORD or column >= columns + _WORD - 1:
                    continue
                under, beside, over = below >> position & 7, here >> position & 7, above >> position & 7
                code = (
                    beside >> 2
                    | (over >> 2) << 1
                    | (over >> 1 & 1) << 2
                    | (over & 1) << 3
                    | (beside & 1) << 4
                    | (under & 1) << 5
                    | (under >> 1 & 1) << 6
                    | (under >> 2) << 7
                )
                if table[code] != 0 and count < limit:
                    found[count, 0], found[count, 1], found[count, 2] = column - _WORD, row - 1, code
                    count += 1
    return count


def _separated(corners: Corners, separation: float) -> Corners:
    """Keep of corners that lie close together the best."""
    if separation <= 0.0 or len(corners) < 2:
        return corners
    order = np.argsort(_PRIORITY[corners.neighbours], kind="stable")
    is_kept = np.zeros(len(corners), np.bool_)
    _keep_apart(corners.points[order], separation**2, order, is_kept)
    return corners.take(np.flatnonzero(is_kept))


@kernel
def _keep_apart(points: Array, squared: float, order: Array, is_kept: Array) -> None:
    """Mark each point, in turn, unless one that is kept lies closer."""
    kept = np.empty(points.shape[0], np.int64)
    count = 0
    for i in range(points.shape[0]):
        is_apart = True
        for k in range(count):
            x, y = points[i, 0] - points[kept[k], 0], points[i, 1] - points[kept[k], 1]
            if x * x + y * y < squared:
                is_apart = False
                break
        if is_apart:
            kept[count] = i
            count += 1
            is_kept[order[i]] = True


def _limited(corners: Corners, limit: int) -> Corners:
    """Return at most a number of corners, by their rank.

    From the last rank, which fits only in part, evenly spaced corners are kept.
    """
    if limit == 0 or len(corners) <= limit:
        return corners
    ranks = _PRIORITY[corners.neighbours]
    kept = np.zeros(0, np.int64)
    for rank in range(4):
        members = np.flatnonzero(ranks == rank)
        room = limit - len(kept)
        if len(members) > room:
            members = members[np.linspace(0, len(members) - 1, room).round().astype(np.int64)] if room else members[:0]
        kept = np.concatenate([kept, members])
    return corners.take(np.sort(kept))
