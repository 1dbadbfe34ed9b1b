"""Tours of a team that share out places among them.

The tours of all robots are one sequence: numbers of places, and between the tours of two robots a number that
is no place's. So one set of moves orders the places of a robot and hands places on to others.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel

_LONGEST_PIECE = 3
"""Pieces of up to so many places are moved to elsewhere."""

_LESS = 1e-9


class TourWeights(NamedTuple):
    """What makes tours good: all are weights of lengths, of which the sum is least.

    Attributes
    ----------
    longest : float
        Weight of the longest tour.
    total : float
        Weight of the sum of the tours.
    waiting : float
        Weight of the way until each place is visited, times what the place is worth.
    """

    longest: float
    total: float
    waiting: float


@kernel
def team_tours(
    first: NDArray[np.float64],
    between: NDArray[np.float64],
    worth: NDArray[np.float64],
    weights: TourWeights,
) -> NDArray[np.int64]:
    """Return which places each robot of a team visits, and in which order.

    The open tours are approximately the best ones. Places are inserted one by one where that costs least, the
    one that costs least first; then pieces are turned round (2-opt; Croes 1958) and moved elsewhere, within a
    tour or to another robot's (Or 1976), until neither helps.

    Parameters
    ----------
    first : (robots, n) float64
        What the path from each robot to each place costs; finite.
    between : (n, n) float64
        What the paths from place to place cost; finite.
    worth : (n,) float64
        What each place is worth.
    weights : TourWeights
        What is least.

    Returns
    -------
    (n + robots - 1,) int64
        Numbers of places, robot after robot; n and above between the places of two robots.
    """
    robots, count = first.shape
    sequence = np.empty(count + robots - 1, np.int64)
    for robot in range(robots - 1):
        sequence[robot] = count + robot
    _insert_all(sequence, first, between, worth, weights)
    trial, rest = np.empty_like(sequence), np.empty_like(sequence)
    cost = _cost(sequence, len(sequence), first, between, worth, weights)
    while True:
        better = _turn_pieces(sequence, trial, first, between, worth, weights, cost)
        better = _move_pieces(sequence, (trial, rest), first, between, worth, weights, better)
        if better >= cost - _LESS:
            return sequence
        cost = better


@kernel
def tours_cost(
    sequence: NDArray[np.int64],
    first: NDArray[np.float64],
    between: NDArray[np.float64],
    worth: NDArray[np.float64],
    weights: TourWeights,
) -> float:
    """Return what tours cost [m]; parameters as in ``costs_of_firsts``."""
    return float(_cost(sequence, sequence.shape[0], first, between, worth, weights))


@kernel
def costs_of_firsts(
    sequence: NDArray[np.int64],
    robot: int,
    first: NDArray[np.float64],
    between: NDArray[np.float64],
    worth: NDArray[np.float64],
    weights: TourWeights,
) -> NDArray[np.float64]:
    """Return by how much tours cost more where a robot visits each place first, (n,).

    All else keeps its order. Where places are equal, or tours are not the best ones, it may be 0 or less.

    Parameters
    ----------
    sequence : (n + robots - 1,) int64
        The tours, as ``team_tours`` returns them.
    robot : int
        Whose tour begins with the place.
    first, between, worth, weights
        As in ``team_tours``.
    """
    count, size = first.shape[1], sequence.shape[0]
    costs = np.empty(count)
    base = _cost(sequence, size, first, between, worth, weights)
    for place in range(count):
        changed = with_first(sequence, robot, place, count)
        costs[place] = _cost(changed, size, first, between, worth, weights) - base
    return costs


@kernel
def with_first(sequence: NDArray[np.int64], robot: int, place: int, count: int) -> NDArray[np.int64]:
    """Return tours past ``count`` places in which a robot visits one of them first; the rest keeps its order.

    Parameters
    ----------
    sequence : (count + robots - 1,) int64
        The tours, as ``team_tours`` returns them.
    robot, place, count : int
        Which robot, which place, and how many places there are.
    """
    changed = np.empty_like(sequence)
    size, tour = 0, 0
    if robot == 0:
        changed[0], size = place, 1
    for number in sequence:
        if number == place:
            continue
        changed[size] = number
        size += 1
        if number >= count:
            tour += 1
            if tour == robot:
                changed[size] = place
                size += 1
    return changed


@kernel
def _cost(
    sequence: Array, size: int, first: Array, between: Array, worth: Array, weights: TourWeights
) -> float:
    """Return what the tours of the first ``size`` numbers of a sequence cost."""
    count = first.shape[1]
    robot, last = 0, -1
    length, longest, total, waiting = 0.0, 0.0, 0.0, 0.0
    for k in range(size):
        place = sequence[k]
        if place >= count:
            robot, last = robot + 1, -1
            longest, total, length = max(longest, length), total + length, 0.0
            continue
        length += first[robot, place] if last < 0 else between[last, place]
        waiting += worth[place] * length
        last = place
    longest, total = max(longest, length), total + length
    return float(weights.longest * longest + weights.total * total + weights.waiting * waiting)


@kernel
def _insert_all(sequence: Array, first: Array, between: Array, worth: Array, weights: TourWeights) -> None:
    """Insert all places into tours without any, each time the one that costs least."""
    robots, count = first.shape
    size = robots - 1
    is_left = np.ones(count, np.bool_)
    trial = np.empty_like(sequence)
    for _ in range(count):
        least, chosen, at = np.inf, -1, 0
        for place in range(count):
            if not is_left[place]:
                continue
            for position in range(size + 1):
                trial[:position] = sequence[:position]
                trial[position] = place
                trial[position + 1 : size + 1] = sequence[position:size]
                cost = _cost(trial, size + 1, first, between, worth, weights)
                if cost < least - _LESS:
                    least, chosen, at = cost, place, position
        for k in range(size, at, -1):
            sequence[k] = sequence[k - 1]
        sequence[at], is_left[chosen] = chosen, False
        size += 1


@kernel
def _turn_pieces(
    sequence: Array,
    trial: Array,
    first: Array,
    between: Array,
    worth: Array,
    weights: TourWeights,
    cost: float,
) -> float:
    """Turn every piece round that makes the tours better; return what they cost."""
    size = sequence.shape[0]
    for start in range(size):
        for end in range(start + 2, size + 1):
            trial[:] = sequence
            trial[start:end] = sequence[start:end][::-1]
            better = _cost(trial, size, first, between, worth, weights)
            if better < cost - _LESS:
                sequence[:], cost = trial, better
    return cost


@kernel
def _move_pieces(
    sequence: Array,
    scratch: tuple[Array, Array],
    first: Array,
    between: Array,
    worth: Array,
    weights: TourWeights,
    cost: float,
) -> float:
    """Move short pieces to where tours get better; return what they cost."""
    trial, rest = scratch
    size = sequence.shape[0]
    for length in range(1, min(_LONGEST_PIECE, size - 1) + 1):
        for start in range(size - length + 1):
            piece = sequence[start : start + length].copy()
            left = size - length
            rest[:start], rest[start:left] = sequence[:start], sequence[start + length :]
            for position in range(left + 1):
                trial[:position] = rest[:position]
                trial[position : position + length] = piece
                trial[position + length :] = rest[position:left]
                better = _cost(trial, size, first, between, worth, weights)
                if better < cost - _LESS:
                    sequence[:], cost = trial, better
                    break
    return cost
