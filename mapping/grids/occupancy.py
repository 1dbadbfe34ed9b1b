"""Occupancy grids in log-odds, updated by scans.

The inverse sensor model is that of the OccupancyGrid algorithm (Thrun, Burgard, Fox: Probabilistic Robotics,
section 9.2) with fans between beams instead of single cones: a cell whose centre the scan has seen becomes
more likely free, a cell in which a beam ended more likely occupied, each once per scan; all others keep
their value. Log-odds are integers of ``LOG_ODDS_UNIT``; 0 is unknown.
"""

import math
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lidarium.mapping.geometry.bounds import check_settings, within
from lidarium.mapping.grids.scan_geometry import ScanGeometry
from lidarium.mapping.grids.scan_integration import WORD, integrate_one
from lidarium.mapping.kernels.simd.cells import LEVELS

LOG_ODDS_UNIT = 0.05

Resolution = Annotated[float, within(1e-4, 1000.0)]
"""Side of a cell [m]."""
Gain = Annotated[float, within(LOG_ODDS_UNIT, 127 * LOG_ODDS_UNIT)]
"""Change of a cell by a scan [log-odds]."""


OCCUPIED, UNKNOWN, FREE = LEVELS


MAX_CELLS = 400_000_000


@dataclass(frozen=True, slots=True, kw_only=True)
class OccupancySettings:
    """Sensor model of a map.

    Attributes
    ----------
    resolution : float, default 0.05
        Side of a cell [m].
    hit : float, default 0.85
        Added to a cell in which a beam ended [log-odds, positive].
    miss : float, default 0.4
        Subtracted from a cell that the scan saw [log-odds, positive].
    minimum : float, default -2.0
        Lower bound of a cell's value [log-odds].
    maximum : float, default 3.5
        Upper bound of a cell's value [log-odds].
    """

    resolution: Resolution = 0.05
    hit: Gain = 0.85
    miss: Gain = 0.4
    minimum: Annotated[float, within(-127 * LOG_ODDS_UNIT, 0.0)] = -2.0
    maximum: Annotated[float, within(0.0, 127 * LOG_ODDS_UNIT)] = 3.5

    def __post_init__(self) -> None:
        check_settings(self, "the map")
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


class OccupancyGrid:
    """A robot's map: a grid of log-odds that grows without moving its coordinates.

    Parameters
    ----------
    settings : OccupancySettings, optional
        Resolution and sensor model.
    bounds : (x_min, y_min, x_max, y_max), optional
        Initial rectangle of the map [m]; empty by default. The map grows beyond it as needed.

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
        """Grow so that the rectangle [m] lies within the map; known cells keep their coordinates."""
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
        right = max(0, high_column - columns) and -(-(max(0, high_column - columns) + spare_columns) // WORD) * WORD
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
        """Update the map by one scan; return the box of cells outside which nothing has changed.

        Raises ValueError if the pose is not finite, the number of ranges is not that of the geometry, or the noise
        is negative or not finite.

        Parameters
        ----------
        pose : (3,)
            x, y, theta of the laser in the map's frame [m, rad].
        ranges : (beams,)
            Ranges [m]; inf for no return, nan for an invalid beam.
        noise : tuple of float
            Standard deviation of the ranges: the larger of the first [m] and the second, a share of the
            range. Returns that it may have put behind a wall count as returns of the wall.
        """
        x, y, theta = np.asarray(pose, np.float64)
        scan = np.asarray(ranges, np.float32)
        if not np.isfinite([x, y, theta]).all():
            raise ValueError(f"pose is ({x}, {y}, {theta}); want finite metres and radians")
        if scan.shape != (geometry.beams,):
            raise ValueError(f"ranges have shape {scan.shape}; want ({geometry.beams},), one per beam")
        if not all(0.0 <= value < math.inf for value in noise):
            raise ValueError(f"noise is {noise}; want a deviation [m] and a share of the range, of 0 or more each")
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
        integrate_one(
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
        """Return the three-level map (rows, columns): 0 occupied, 127 unknown, 255 free."""
        return three_levels(self.log_odds)

    def probability(self) -> NDArray[np.float32]:
        """Return the probability of being occupied, shape (rows, columns)."""
        return np.asarray(1.0 / (1.0 + np.exp(-LOG_ODDS_UNIT * self.log_odds.astype(np.float32))), np.float32)


def three_levels(log_odds: NDArray[np.signedinteger[Any]]) -> NDArray[np.uint8]:
    """Return 0 for occupied, 127 for unknown and 255 for free cells."""
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
