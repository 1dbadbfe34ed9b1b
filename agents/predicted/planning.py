"""Costs of the options of tours on a predicted map: the remaining path if a robot takes that option first."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from lidarium.agents.tours.planning import TourOptions, first_places
from lidarium.mapping.kernels.simd.lengths import FAR, STRAIGHT
from lidarium.mapping.planning.touring.expected_views import cover, shares_left
from lidarium.mapping.planning.touring.many_lengths import lengths_between
from lidarium.mapping.planning.touring.map_tours import NO_PATH
from lidarium.mapping.planning.touring.tours import TourWeights, team_tours, tours_cost

LATTICE = 3
"""Distance between stops, which lie on a lattice [squares]."""

MOST_COVER, MOST_NEAR, MOST_STOPS = 60, 24, 16
"""Maximum number of stops that cover the unseen area, of those nearest in a straight line, and of those on tours."""

LEAST_STOPS = ((0.4, 1.0), (0.2, 0.5), (0.08, 0.0))
"""Stops that show less than the first are left out [m2], and so is the second's share of what may stay unseen. If no
stop is left, the next ones hold: squares are too coarse to tell when enough is seen."""

KEPT_SHARE = 0.15
"""A stop is left out if an option shows all but this share of its area."""

VISIT_M = 0.5
"""Cost of slowing down, turning and setting out at each stop [m]."""

LEAST_SAVED = 0.5
"""Robots depart from tours, which may have nothing for them, if that saves so much [m]."""

LEAST_EXTRA = 0.01
"""Least extra cost of options besides the one that tours begin with [m]."""

WEIGHTS = TourWeights(1.0, 0.4, 0.0)
"""Weights of tours past stops: the longest, the sum, and nothing for waiting."""


@dataclass(frozen=True, slots=True)
class Rest:
    """The unseen area of a predicted map, and the stops from which it is seen.

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
    sensor_range: float,
    enough: float,
) -> Rest | None:
    """Return the unseen area that is left, None if it is too small for a stop.

    Parameters
    ----------
    free, unseen : (rows, columns) float32
        Probability that a square is free, and that it is free and not seen.
    squares : (float, int)
        Side of a square [m], and cells of the map along it.
    sensor_range : float
        How far the lasers see [m].
    enough : float
        Share of the free area that has to be seen.
    """
    (side, factor), is_open = squares, free > 0.5
    poses = np.array([[robot.pose[1], robot.pose[0]] for robot in options.robots])
    corner = np.array([options.grid.row, options.grid.column])
    cells = corner + (options.places + 0.5) * options.grid.factor
    robots, views = _squares_of(poses / side, free.shape), _squares_of(cells / factor, free.shape)
    # Bodies stand there, even if a square of theirs has a part of a wall.
    is_open[robots[:, 0], robots[:, 1]] = is_open[views[:, 0], views[:, 1]] = True
    places = _places(is_open, np.concatenate([robots, views]))
    reach, spare = round(sensor_range / side), (1.0 - enough) * float(free.sum())
    for least, share in LEAST_STOPS:
        chosen, _ = cover(free, unseen, places, reach, least / side**2, share * spare, MOST_COVER)
        if len(chosen):
            break
    else:
        return None
    stops = places[chosen]
    gaps = np.abs(stops[:, None] - robots[None]).max(axis=2).min(axis=1)
    stops = stops[np.argsort(gaps, kind="stable")[:MOST_NEAR]]
    paths = _path_lengths(is_open, stops, np.concatenate([robots, views, stops]), side)
    to_robots, to_views, to_stops = np.split(paths, [len(robots), len(robots) + len(views)], axis=1)
    # Squares close gaps that bodies fit through: in known space, paths between options are those of finer cells.
    from_options = np.minimum(to_views.T, _shortest(options.between, to_views.T))
    from_robots = np.minimum(to_robots.T, _shortest(options.lengths, to_views.T))
    between = np.minimum(to_stops, _shortest(to_views, from_options))
    nearest = np.argsort(from_robots.min(axis=0), kind="stable")[:MOST_STOPS]
    stops = stops[nearest]
    return Rest(
        options,
        from_robots[:, nearest],
        from_options[:, nearest],
        between[np.ix_(nearest, nearest)],
        shares_left(free, unseen, stops, views, reach),
    )


def _squares_of(places: NDArray[np.float64], shape: tuple[int, ...]) -> NDArray[np.int64]:
    """Return the squares of places (n, 2), row and column in squares."""
    return np.clip(np.floor(places), 0, np.array(shape) - 1).astype(np.int64)


def _places(is_open: NDArray[np.bool_], starts: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the open squares of a lattice that are connected to any of some starts, (n, 2)."""
    _, labels = cv2.connectedComponents(is_open.astype(np.uint8), connectivity=8, ltype=cv2.CV_32S)
    reached = np.zeros(int(labels.max()) + 1, np.bool_)
    reached[labels[starts[:, 0], starts[:, 1]]] = True
    part = labels[::LATTICE, ::LATTICE]
    return np.argwhere(reached[part] & (part > 0)) * LATTICE


def _shortest(first: NDArray[np.float64], second: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the lengths of the shortest paths of two pieces, (n, k) of (n, m) and (m, k)."""
    return np.asarray((first[:, :, None] + second[None]).min(axis=1))


def costs_of(rest: Rest, robot: int, picks: list[int | None]) -> NDArray[np.float64]:
    """Return the cost of all tours if a robot sets out to each option, (options,) [m]; inf if it cannot.

    ``picks`` are the options of the robots before it.
    """
    begin, left = _begun(rest, picks)
    mask = rest.options.is_reached[robot].copy()
    mask[[pick for pick in picks if pick is not None]] = False
    costs = np.full(len(mask), np.inf)
    for option in np.flatnonzero(mask):
        leg = float(rest.options.first[robot, option])
        begin[robot] = leg + rest.lengths[option]
        costs[option] = _cost(rest, robot, begin, left * rest.left[option], leg)
    return costs


def _begun(rest: Rest, picks: list[int | None]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the paths to all stops, (robots, stops) [m], and the share left of each, after all picks."""
    begin, left = rest.robots.copy(), np.ones(rest.left.shape[1])
    for robot, pick in enumerate(picks):
        if pick is not None:
            begin[robot] = rest.options.first[robot, pick] + rest.lengths[pick]
            left = left * rest.left[pick]
    return begin, left


def _cost(rest: Rest, robot: int, begin: NDArray[np.float64], left: NDArray[np.float64], leg: float) -> float:
    """Return the cost of all tours [m], and of the first leg of a robot that visits nothing after it."""
    wanted = left > KEPT_SHARE
    if not wanted.any():
        return leg * (WEIGHTS.longest + WEIGHTS.total)
    starts = np.minimum(begin[:, wanted], NO_PATH) + VISIT_M
    between = np.ascontiguousarray(rest.between[wanted][:, wanted]) + VISIT_M
    worth = np.zeros(len(between))
    tours = team_tours(starts, between, worth, WEIGHTS)
    cost = float(tours_cost(tours, starts, between, worth, WEIGHTS))
    return cost if first_places(tours, len(worth))[robot] is not None else cost + WEIGHTS.total * leg


def extra_costs(rest: Rest, robot: int, first: int | None, picks: list[int | None]) -> NDArray[np.float64]:
    """Return by how much all tours cost more if a robot sets out to each option, (options,) [m]; inf if it cannot.

    The option ``first``, with which its own tour begins, costs nothing if it is the robot's goal (then no other one is
    rated), or if no other one saves much. A robot without a tour has no option if none saves much: it would take it
    from a teammate that is nearer.
    """
    is_open = first is not None and first not in picks
    if is_open and rest.options.is_kept[robot, first]:
        extra = np.full(len(rest.lengths), np.inf)
        extra[first] = 0.0
        return extra
    costs = costs_of(rest, robot, picks)
    least = costs.min()
    if first is None and least > _cost(rest, robot, *_begun(rest, picks), 0.0) - LEAST_SAVED:
        return np.full(len(costs), np.inf)
    extra = costs - least if np.isfinite(least) else costs
    if is_open and costs[first] <= least + LEAST_SAVED:
        extra = np.maximum(extra, LEAST_EXTRA)
        extra[first] = 0.0
    return extra


def _path_lengths(
    is_open: NDArray[np.bool_], starts: NDArray[np.int64], ends: NDArray[np.int64], side: float
) -> NDArray[np.float64]:
    """Return the lengths of paths over open squares from each of some to each of others [m]."""
    bordered = np.pad(is_open, 1).view(np.uint8)
    lengths = lengths_between(bordered, *((each + 1) @ (bordered.shape[1], 1) for each in (starts, ends)))
    return np.where(lengths == FAR, NO_PATH, lengths * (side / STRAIGHT))
