"""The shortest tour of all places that are left to see.

It determines which of them comes first.
"""

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel

_BEGINNINGS = 4
"""So many tours are improved, each from another of the nearest places."""

_LONGEST_PIECE = 3
"""Pieces of up to so many places are moved to elsewhere in a tour."""

_LESS = 1e-9


@kernel
def shortest_tour(first: NDArray[np.float64], between: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return the order in which an open tour visits all places.

    The tour is approximately the shortest one.

    Tours go on to the nearest place from each of the nearest beginnings, and are improved by turning pieces
    round (2-opt; Croes 1958) and by moving pieces elsewhere (Or 1976) until neither helps. Explorers that
    plan so and drive to the first place have shorter ways than those that go to the nearest one (Kulich,
    Faigl and Preucil 2011).

    Parameters
    ----------
    first : (n,) float64
        What the way from the robot to each place costs; finite.
    between : (n, n) float64
        What the ways from place to place cost; finite and symmetric.

    Returns
    -------
    (n,) int64
        The places in order.
    """
    count = first.shape[0]
    best, best_length = np.arange(count), np.inf
    nearest = np.argsort(first, kind="mergesort")
    tour, trial = np.empty(count, np.int64), np.empty(count, np.int64)
    for beginning in range(min(_BEGINNINGS, count)):
        _go_to_nearest(nearest[beginning], between, tour)
        length = _length(tour, first, between)
        while True:
            shorter = _turn_pieces(tour, trial, first, between, length)
            shorter = _move_pieces(tour, trial, first, between, shorter)
            if shorter >= length - _LESS:
                break
            length = shorter
        if length < best_length - _LESS:
            best[:], best_length = tour, length
    return best


@kernel
def _length(tour: Array, first: Array, between: Array) -> float:
    length = first[tour[0]]
    for k in range(1, tour.shape[0]):
        length += between[tour[k - 1], tour[k]]
    return float(length)


@kernel
def _go_to_nearest(beginning: int, between: Array, tour: Array) -> None:
    """Write the tour that goes on to the nearest place that is left."""
    count = tour.shape[0]
    is_left = np.ones(count, np.bool_)
    tour[0], is_left[beginning] = beginning, False
    for k in range(1, count):
        nearest = -1
        for place in range(count):
            if is_left[place] and (
                nearest < 0 or between[tour[k - 1], place] < between[tour[k - 1], nearest]
            ):
                nearest = place
        tour[k], is_left[nearest] = nearest, False


@kernel
def _turn_pieces(tour: Array, trial: Array, first: Array, between: Array, length: float) -> float:
    """Turn every piece round that makes the tour shorter; return its length."""
    count = tour.shape[0]
    for start in range(count):
        for end in range(start + 2, count + 1):
            trial[:] = tour
            trial[start:end] = tour[start:end][::-1]
            shorter = _length(trial, first, between)
            if shorter < length - _LESS:
                tour[:], length = trial, shorter
    return length


@kernel
def _move_pieces(tour: Array, trial: Array, first: Array, between: Array, length: float) -> float:
    """Move every short piece to where it makes the tour shorter; return its length."""
    count = tour.shape[0]
    rest = np.empty(count, np.int64)
    for size in range(1, min(_LONGEST_PIECE, count - 1) + 1):
        for start in range(count - size + 1):
            piece = tour[start : start + size].copy()
            left = count - size
            rest[:start], rest[start:left] = tour[:start], tour[start + size :]
            for place in range(left + 1):
                trial[:place], trial[place : place + size], trial[place + size :] = (
                    rest[:place],
                    piece,
                    rest[place:left],
                )
                shorter = _length(trial, first, between)
                if shorter < length - _LESS:
                    tour[:], length = trial, shorter
                    break
    return length
