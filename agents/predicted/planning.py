"""Costs of the options of tours on a predicted map: what is left to drive where each comes first."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidarium.agents.tours.planning import NO_PATH, TourOptions
from lidarium.mapping.planning.touring.coarse_distances import STRAIGHT, UNREACHED, CoarseGrid, distances_from
from lidarium.mapping.planning.touring.expected_views import cover, shares_left
from lidarium.mapping.planning.touring.tours import TourWeights, team_tours, tours_cost

LATTICE = 3
"""Stops are places of a lattice of so many squares."""

MOST_COVER, MOST_STOPS = 60, 16
"""Maximum number of stops that cover what is left, and of the nearest that tours pass."""

LEAST_STOP = 0.4
"""Stops that show less than this are left out [m2]."""

KEPT_SHARE = 0.15
"""A stop is left out if an option shows all but this share of its area."""

VISIT_M = 0.5
"""Cost of slowing down, turning and setting out at each stop [m]."""

WEIGHTS = TourWeights(1.0, 0.4, 0.0)
"""Weights of tours past stops: the longest, the sum, and nothing for waiting."""


@dataclass(frozen=True, slots=True)
class Rest:
    """What is left to see on a predicted map, and stops that show it.

    Attributes
    ----------
    options : TourOptions
        The options of the robots.
    robots : (robots, stops) float64
        Lengths of the paths from each robot to each stop [m].
    lengths : (options, stops) float64
        And from each option.
    between : (stops, stops) float64
        And between stops.
    left : (options, stops) float64
        Share of each stop's area that an option does not show.
    """

    options: TourOptions
    robots: NDArray[np.float64]
    lengths: NDArray[np.float64]
    between: NDArray[np.float64]
    left: NDArray[np.float64]


def rest_of(
    options: TourOptions,
    free: NDArray[np.float32],
    unseen: NDArray[np.float32],
    squares: tuple[float, int],
    reach: float,
    enough: float,
) -> Rest | None:
    """Return what is left to see, None if that is too little for a stop.

    Parameters
    ----------
    free, unseen : (rows, columns) float32
        Probability that a square is free, and that it is free and not seen.
    squares : (float, int)
        Side of a square [m], and cells of the map along it.
    reach : float
        How far the lasers see [m].
    enough : float
        Share of the free area that has to be seen.
    """
    (side, factor), is_open = squares, free > 0.5
    grid = CoarseGrid(is_open, factor, 0, 0, side, 0)
    poses = np.array([[robot.pose[1], robot.pose[0]] for robot in options.robots])
    robots = np.clip(poses // side, 0, np.array(free.shape) - 1).astype(np.int64)
    views = (np.array([options.grid.row, options.grid.column]) + (options.places + 0.5) * options.grid.factor).astype(
        np.int64
    ) // factor
    cells = round(reach / side)
    from_robots = distances_from(grid, robots)
    nearest = from_robots.min(axis=0)
    lattice = np.zeros(is_open.shape, np.bool_)
    lattice[::LATTICE, ::LATTICE] = True
    places = np.argwhere(lattice & is_open & (nearest < UNREACHED))
    spare = (1.0 - enough) * float(free.sum())
    chosen, _ = cover(free, unseen, places, cells, LEAST_STOP / side**2, spare, MOST_COVER)
    if not len(chosen):
        return None
    stops = places[chosen]
    order = np.argsort(nearest[stops[:, 0], stops[:, 1]], kind="stable")[:MOST_STOPS]
    stops = stops[order]
    fields = distances_from(grid, stops)
    return Rest(
        options,
        _metres(fields[:, robots[:, 0], robots[:, 1]].T, side),
        _metres(fields[:, views[:, 0], views[:, 1]].T, side),
        _metres(fields[:, stops[:, 0], stops[:, 1]], side),
        shares_left(free, unseen, stops, views, cells),
    )


def costs_of(rest: Rest, robot: int, picks: list[int | None]) -> NDArray[np.float64]:
    """Return the cost of all tours if a robot sets out to each option, (options,) [m]; inf if it cannot.

    ``picks`` are the options of the robots before it.
    """
    options = rest.options
    mask = options.is_reached[robot].copy()
    mask[[pick for pick in picks if pick is not None]] = False
    costs = np.full(len(mask), np.inf)
    begin, left = rest.robots.copy(), np.ones(rest.left.shape[1])
    for other, pick in enumerate(picks):
        if pick is not None:
            begin[other] = options.first[other, pick] + rest.lengths[pick]
            left = left * rest.left[pick]
    for option in np.flatnonzero(mask):
        first = float(options.first[robot, option])
        wanted = left * rest.left[option] > KEPT_SHARE
        begin[robot] = first + rest.lengths[option]
        if not wanted.any():
            costs[option] = first * (WEIGHTS.longest + WEIGHTS.total)
            continue
        starts = np.minimum(begin[:, wanted], NO_PATH) + VISIT_M
        between = np.ascontiguousarray(rest.between[wanted][:, wanted]) + VISIT_M
        worth = np.zeros(int(wanted.sum()))
        tours = team_tours(starts, between, worth, WEIGHTS)
        costs[option] = tours_cost(tours, starts, between, worth, WEIGHTS)
    return costs


def _metres(lengths: NDArray[np.int32], side: float) -> NDArray[np.float64]:
    return np.where(lengths == UNREACHED, NO_PATH, lengths * (side / STRAIGHT))
