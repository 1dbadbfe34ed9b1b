"""Occupancy grids in log-odds, updated by scans.

The inverse sensor model is that of the OccupancyGrid algorithm (Thrun, Burgard, Fox: Probabilistic Robotics,
section 9.2) with the beams' fans in place of single cones: a cell whose centre the scan has seen becomes more
likely free, a cell in which a beam ended more likely occupied, each once per scan; all others keep their
value. Log-odds are integers of ``LOG_ODDS_UNIT``; 0 is unknown.
"""

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lidarium.mapping.grids.noisy_returns import settle_returns
from lidarium.mapping.grids.scan_geometry import ScanGeometry, beam_directions
from lidarium.mapping.grids.scan_polygon import fill_scan_polygon, scan_ends, window_rows, window_words
from lidarium.mapping.kernels.cell_blocks import fetch_block, update_block
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.vectors import LEVELS

LOG_ODDS_UNIT = 0.05
OCCUPIED, UNKNOWN, FREE = LEVELS
WORD = 64
MAX_CELLS = 400_000_000

ROWS_AHEAD = 12
"""So many rows before a row of a map is updated it is fetched from memory."""


@dataclass(frozen=True, slots=True, kw_only=True)
class OccupancySettings:
    """How scans change the log-odds.

    Attributes
    ----------
    resolution : float
        Side of a cell [m].
    hit, miss : float
        Added where a beam ended, taken where the scan saw through [log-odds, positive].
    minimum, maximum : float
        Bounds of a cell's value [log-odds].
    """

    resolution: float = 0.05
    hit: float = 0.85
    miss: float = 0.4
    minimum: float = -2.0
    maximum: float = 3.5

    def __post_init__(self) -> None:
        if not (self.resolution > 0.0 and math.isfinite(self.resolution)):
            raise ValueError(f"resolution of the map is {self.resolution} m/cell; want more than 0")
        if not (self.hit >= LOG_ODDS_UNIT and self.miss >= LOG_ODDS_UNIT):
            raise ValueError(f"hit is {self.hit} and miss is {self.miss}; want at least {LOG_ODDS_UNIT} each")
        largest = 127 * LOG_ODDS_UNIT
        if not (-largest <= self.minimum <= -self.miss and self.hit <= self.maximum <= largest):
            raise ValueError(
                f"log-odds are bounded to [{self.minimum}, {self.maximum}]; "
                f"want minimum in [{-largest}, -miss] and maximum in [hit, {largest}]"
            )

    @property
    def increments(self) -> NDArray[np.int64]:
        """Hit, miss, minimum and maximum in units of ``LOG_ODDS_UNIT``, shape (4,)."""
        return np.array(
            [round(value / LOG_ODDS_UNIT) for value in (self.hit, self.miss, self.minimum, self.maximum)],
            np.int64,
        )


@kernel(borrowing=True)
def _note_hits(ends: Array, is_hit: Array, hit_bits: Array) -> None:
    """Set the bits of the cells in which beams ended."""
    flat, words = hit_bits.reshape(-1), hit_bits.shape[1]
    for beam in range(is_hit.shape[0]):
        row, column = int(ends[1, beam]), int(ends[0, beam])
        flat[np.uintp(row * words + (column >> 6))] |= np.uint64(is_hit[beam]) << np.uint64(column & 63)


class SeenScan(NamedTuple):
    """What a scan has seen, in a window of bits.

    Attributes
    ----------
    bits, hit_bits : (window rows, words) uint64
        The seen area of ``fill_scan_polygon``, and zeros (the hits are noted).
    box : tuple of int
        The box of the window that may hold bits; the ends of the beams lie in it.
    ends, is_hit : (2, beams) float64 and (beams,) bool
        End points of the beams in the window [cells], and whether something ended them.
    row_offset, column_offset : int
        Place of the window's first cell in the map; column_offset a multiple of 64.
    """

    bits: NDArray[np.uint64]
    hit_bits: NDArray[np.uint64]
    box: tuple[int, int, int, int]
    ends: NDArray[np.float64]
    is_hit: NDArray[np.bool_]
    row_offset: int
    column_offset: int


@kernel(borrowing=True)
def integrate_scan(log_odds: Array, scan: SeenScan, increments: Array, touched: Array) -> None:
    """Update a map by a scan.

    Seen cells are lowered, and cells in which beams ended are raised, each once.

    Parameters
    ----------
    log_odds : (rows, columns) int8
        The map; columns a multiple of 64.
    scan : SeenScan
        What it has seen.
    increments : (4,) int64
        ``OccupancySettings.increments``.
    touched : (rows + rows / 64, words) uint64
        Bits of the words of 64 cells of each row in which a level has changed, and of these rows
        (``pooled_maps.untouched``); added to. None are noted where it has no rows.
    """
    bits, hit_bits, box, ends, is_hit, row_offset, column_offset = scan
    _note_hits(ends, is_hit, hit_bits)
    hit, miss, minimum, maximum = increments[0], increments[1], increments[2], increments[3]
    rows, columns = log_odds.shape
    words, word_offset = columns // WORD, column_offset // WORD
    word_low, word_high = max(box[2], -word_offset), min(box[3], words - word_offset)
    is_noted = touched.shape[0] > 0
    row_low, row_high = max(box[0], -row_offset), min(box[1], rows - row_offset)
    for row in range(row_low, row_high):
        address = log_odds.ctypes.data + (row + row_offset) * columns + word_offset * WORD
        # The rows of a map lie too far apart for the processor to foresee them.
        ahead = address + min(ROWS_AHEAD, row_high - 1 - row) * columns
        changes = np.uint64(0)
        for word in range(word_low, word_high):
            seen, hits = bits[row, word], hit_bits[row, word]
            fetch_block(ahead + word * WORD)
            if seen | hits != np.uint64(0):
                changed = update_block(address + word * WORD, seen, hits, hit, miss, minimum, maximum)
                changes |= np.uint64(changed != np.uint64(0)) << np.uint64((word + word_offset) & 63)
            is_last_of_group = word + 1 == word_high or (word + 1 + word_offset) & 63 == 0
            if is_last_of_group and is_noted and changes != np.uint64(0):
                of_map = row + row_offset
                touched[of_map, (word + word_offset) >> 6] |= changes
                touched[rows + (of_map >> 6), 0] |= np.uint64(1) << np.uint64(of_map & 63)
                changes = np.uint64(0)


@kernel
def _integrate_one(
    log_odds: Array,
    place: tuple[float, float, float],
    ranges: Array,
    geometry: tuple[float, float, float, float],
    unit_vectors: Array,
    increments: Array,
    noise: tuple[float, float],
    window: Array,
) -> None:
    """Update a map by one scan at x, y [cells], heading.

    ``geometry`` is (increment, range_max [cells], cells per metre, full circle).
    """
    x, y, heading = place
    reach, scale = geometry[1], geometry[2]
    beams = ranges.shape[0]
    directions = np.empty((4, beams))
    beam_directions(heading, unit_vectors, directions)
    lengths, ends = np.empty(beams), np.empty((2, beams))
    is_hit = np.empty(beams, np.bool_)
    for beam in range(beams):
        value = float(ranges[beam])
        is_hit[beam] = math.isfinite(value) and value * scale <= reach
        lengths[beam] = 0.0 if math.isnan(value) else min(value * scale, reach)
    if noise[0] > 0.0 or noise[1] > 0.0:
        in_cells = (noise[0] * scale, noise[1])
        settle_returns(log_odds, x, y, lengths, directions, is_hit, in_cells, increments[0])
    bits = np.zeros((window_rows(reach), window_words(reach)), np.uint64)
    margin = int(reach) + 3
    row_offset = int(math.floor(y)) - margin
    column_offset = ((int(math.floor(x)) - margin) >> 6) << 6
    local_x, local_y = x - column_offset, y - row_offset
    scan_ends(lengths, directions, local_x, local_y, ends)
    box = fill_scan_polygon(
        lengths, directions, ends, local_x, local_y, geometry[0], geometry[3] != 0.0, bits
    )
    window[0], window[1] = box[0] + row_offset, box[1] + row_offset
    window[2], window[3] = 64 * box[2] + column_offset, 64 * box[3] + column_offset
    seen = SeenScan(bits, np.zeros_like(bits), box, ends, is_hit, row_offset, column_offset)
    integrate_scan(log_odds, seen, increments, np.empty((0, 1), np.uint64))


class OccupancyGrid:
    """A robot's map: a grid of log-odds that grows without moving its coordinates.

    Parameters
    ----------
    settings : OccupancySettings
        Resolution and sensor model.
    bounds : (x_min, y_min, x_max, y_max) or None
        Rectangle that the map holds from the start [m]; it grows beyond it where needed.

    Attributes
    ----------
    log_odds : (rows, columns) int8
        Units of ``LOG_ODDS_UNIT``; 0 unknown, negative free, positive occupied. Row 0 at the lowest y.
    origin : (x, y)
        Lower left corner of cell (0, 0) [m], always a whole number of cells from the first origin.
    """

    def __init__(
        self,
        settings: OccupancySettings | None = None,
        bounds: tuple[float, float, float, float] | None = None,
    ) -> None:
        self.settings = settings or OccupancySettings()
        low_x, low_y, high_x, high_y = bounds or (0.0, 0.0, 0.0, 0.0)
        resolution = self.settings.resolution
        self._first_column = math.floor(low_x / resolution + 1e-9)
        self._first_row = math.floor(low_y / resolution + 1e-9)
        rows = max(math.ceil(high_y / resolution - 1e-9) - self._first_row, 0)
        columns = max(math.ceil(high_x / resolution - 1e-9) - self._first_column, 0)
        self.log_odds: NDArray[np.int8] = _blank(rows, -(-columns // WORD) * WORD)

    @property
    def origin(self) -> tuple[float, float]:
        """Lower left corner of cell (0, 0) [m]."""
        return self._first_column * self.settings.resolution, self._first_row * self.settings.resolution

    def contain(self, x_min: float, y_min: float, x_max: float, y_max: float) -> None:
        """Grow so that the rectangle [m] lies within the map.

        What is known keeps its place.
        """
        resolution = self.settings.resolution
        rows, columns = self.log_odds.shape
        low_row, high_row = (
            math.floor(y_min / resolution) - self._first_row,
            math.ceil(y_max / resolution) - self._first_row,
        )
        low_column = math.floor(x_min / resolution) - self._first_column
        high_column = math.ceil(x_max / resolution) - self._first_column
        if low_row >= 0 and high_row <= rows and low_column >= 0 and high_column <= columns:
            return
        # Half of the new size on each grown side, so that a drive across a building grows the map a few times
        # only.
        spare_rows, spare_columns = rows // 2, columns // 2
        below = max(0, -low_row) and max(0, -low_row) + spare_rows
        above = max(0, high_row - rows) and max(0, high_row - rows) + spare_rows
        left = max(0, -low_column) and -(-(max(0, -low_column) + spare_columns) // WORD) * WORD
        right = (
            max(0, high_column - columns)
            and -(-(max(0, high_column - columns) + spare_columns) // WORD) * WORD
        )
        grown = _blank(below + rows + above, left + columns + right)
        grown[below : below + rows, left : left + columns] = self.log_odds
        self.log_odds = grown
        self._first_row -= below
        self._first_column -= left

    def integrate(
        self,
        pose: ArrayLike,
        ranges: ArrayLike,
        geometry: ScanGeometry,
        noise: tuple[float, float] = (0.0, 0.0),
    ) -> tuple[int, int, int, int]:
        """Update the map by one scan.

        Parameters
        ----------
        pose : (3,)
            x, y, theta of the laser in the map's frame [m, rad].
        ranges : (beams,)
            Ranges [m]; inf for no return, nan for an invalid beam.
        geometry : ScanGeometry
            Which way the beams look.
        noise : tuple of float
            Standard deviation of the ranges: the larger of the first [m] and the second, a share of the
            range. Returns that it may have put behind a wall count as returns of the wall.

        Returns
        -------
        tuple of int
            row_low, row_high, column_low, column_high: the cells outside did not change (high ends
            exclusive).

        Raises
        ------
        ValueError
            Where the pose is not finite, the number of ranges is not that of the geometry, or the noise is
            negative or not finite.
        """
        x, y, theta = np.asarray(pose, np.float64)
        scan = np.asarray(ranges, np.float32)
        if not np.isfinite([x, y, theta]).all():
            raise ValueError(f"pose is ({x}, {y}, {theta}); want finite metres and radians")
        if scan.shape != (geometry.beams,):
            raise ValueError(f"ranges have shape {scan.shape}; want ({geometry.beams},), one per beam")
        if not all(0.0 <= value < math.inf for value in noise):
            raise ValueError(
                f"noise is {noise}; want a deviation [m] and a share of the range, of 0 or more each"
            )
        resolution, reach = self.settings.resolution, geometry.range_max
        margin = 4 * resolution
        self.contain(x - reach - margin, y - reach - margin, x + reach + margin, y + reach + margin)
        window = np.zeros(4, np.int64)
        numbers = (
            geometry.angle_increment,
            reach / resolution,
            1.0 / resolution,
            float(geometry.is_full_circle),
        )
        grid_x, grid_y = x / resolution - self._first_column, y / resolution - self._first_row
        deviation, share = noise
        _integrate_one(
            self.log_odds,
            (grid_x, grid_y, theta),
            scan,
            numbers,
            geometry.unit_vectors,
            self.settings.increments,
            (float(deviation), float(share)),
            window,
        )
        rows, columns = self.log_odds.shape
        low_row, high_row, low_column, high_column = (int(value) for value in window)
        return max(low_row - 1, 0), min(high_row + 1, rows), max(low_column, 0), min(high_column, columns)

    def levels(self) -> NDArray[np.uint8]:
        """Return the three-level map, shape (rows, columns).

        Levels: 0 occupied, 127 unknown, 255 free.
        """
        return three_levels(self.log_odds)

    def probability(self) -> NDArray[np.float32]:
        """Return the probability of being occupied, shape (rows, columns)."""
        return np.asarray(1.0 / (1.0 + np.exp(-LOG_ODDS_UNIT * self.log_odds.astype(np.float32))), np.float32)


def three_levels(log_odds: NDArray[np.signedinteger[Any]]) -> NDArray[np.uint8]:
    """Return 0 where occupied, 127 where unknown, 255 where free."""
    levels = np.full(log_odds.shape, UNKNOWN, np.uint8)
    levels[log_odds > 0] = OCCUPIED
    levels[log_odds < 0] = FREE
    return levels


def _blank(rows: int, columns: int) -> NDArray[np.int8]:
    if rows * columns > MAX_CELLS:
        raise ValueError(
            f"a map of {rows} x {columns} cells is larger than {MAX_CELLS} cells; use a coarser resolution"
        )
    return np.zeros((rows, columns), np.int8)
