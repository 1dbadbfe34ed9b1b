"""Open tours past places: the shortest one of a robot, and those of a team that shares the places.

The tours of a team are one sequence: indices of places, and between the tours of two robots a number above
all indices. So one set of moves orders the places of a robot and moves places to other robots.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.ordering import stable_order

_BEGINNINGS = 4
"""Number of tours that are improved, each from another of the nearest places."""

_LONGEST_PIECE = 3
"""Maximum number of places of a piece that is moved within a tour or to another one."""

_LESS = 1e-9


@kernel
def shortest_tour(first: NDArray[np.float64], between: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return the order, (n,) int64, in which an approximately shortest open tour visits all places.

    Tours continue at the nearest place from each of the nearest beginnings, and are improved by reversing pieces
    (2-opt; Croes 1958) and by moving pieces (Or 1976) until neither helps. Explorers that plan tours and drive to
    the first place have shorter paths than those that go to the nearest one (Kulich, Faigl and Preucil 2011).

    Parameters
    ----------
    first : (n,) float64
        Cost of the path from the robot to each place; finite.
    between : (n, n) float64
        Cost of the paths between places; finite and symmetric.
    """
    count = first.shape[0]
    best, best_length = np.arange(count), np.inf
    nearest = stable_order(first)
    tour, trial = np.empty(count, np.int64), np.empty(count, np.int64)
    for beginning in range(min(_BEGINNINGS, count)):
        _go_to_nearest(nearest[beginning], between, tour)
        length = _length(tour, first, between)
        while True:
            shorter = _shorten_by_turns(tour, trial, first, between, length)
            shorter = _shorten_by_moves(tour, trial, first, between, shorter)
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
    """Write the tour that continues at the nearest remaining place."""
    count = tour.shape[0]
    is_left = np.ones(count, np.bool_)
    tour[0], is_left[beginning] = beginning, False
    for k in range(1, count):
        nearest = -1
        for place in range(count):
            if is_left[place] and (nearest < 0 or between[tour[k - 1], place] < between[tour[k - 1], nearest]):
                nearest = place
        tour[k], is_left[nearest] = nearest, False


@kernel
def _shorten_by_turns(tour: Array, trial: Array, first: Array, between: Array, length: float) -> float:
    """Reverse every piece that makes the tour shorter; return its length."""
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
def _shorten_by_moves(tour: Array, trial: Array, first: Array, between: Array, length: float) -> float:
    """Move every short piece to a position that makes the tour shorter; return its length."""
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


class TourWeights(NamedTuple):
    """Weights of lengths, whose sum is the cost of tours.

    Attributes
    ----------
    longest : float
        Weight of the longest tour.
    total : float
        Weight of the sum of the tours.
    waiting : float
        Weight of the path until each place is visited, times the place's worth.
    """

    longest: float
    total: float
    waiting: float


class _Costs(NamedTuple):
    """Costs of legs as in ``team_tours``.

    Attributes
    ----------
    can_stop : bool
        Whether no leg costs less than nothing: then the cost of a part is no greater than that of the whole.
    """

    first: NDArray[np.float64]
    between: NDArray[np.float64]
    worth: NDArray[np.float64]
    weights: TourWeights
    can_stop: bool


class _State(NamedTuple):
    """The robot and its last place on the way along a sequence, its length so far, and those of all before."""

    robot: int
    last: int
    length: float
    longest: float
    total: float
    waiting: float


@kernel(forceinline=True, nrt=False)
def _visit(state: _State, place: int, costs: _Costs) -> _State:
    """Return the state after another number of a sequence."""
    robot, last, length, longest, total, waiting = state
    if place >= costs.first.shape[1]:
        return _State(robot + 1, np.int64(-1), 0.0, max(longest, length), total + length, waiting)  # type: ignore[arg-type]
    length += costs.first[robot, place] if last < 0 else costs.between[last, place]
    return _State(robot, place, length, longest, total, waiting + costs.worth[place] * length)


@kernel(forceinline=True, nrt=False)
def _total(state: _State, weights: TourWeights) -> float:
    """Return the cost of the tours so far."""
    longest, total = max(state.longest, state.length), state.total + state.length
    return weights.longest * longest + weights.total * total + weights.waiting * state.waiting


@kernel(forceinline=True, nrt=False)
def _is_over(state: _State, costs: _Costs, limit: float) -> bool:
    """Whether tours that begin thus cost a limit or more."""
    return costs.can_stop and _total(state, costs.weights) >= limit


@kernel(nrt=False)
def _begin() -> _State:
    """Return the state before the first number of a sequence."""
    return _State(np.int64(0), np.int64(-1), 0.0, 0.0, 0.0, 0.0)  # type: ignore[arg-type]


@kernel(nrt=False)
def _visit_all(state: _State, sequence: Array, first: int, last: int, costs: _Costs, limit: float) -> _State:
    """Return the state after a part of a sequence, or earlier once the tours cost a limit or more."""
    for k in range(first, last):
        state = _visit(state, sequence[k], costs)
        if _is_over(state, costs, limit):
            break
    return state


_REST, _WORTH, _WAITING, _LATER_LONGEST, _LATER_TOTAL, _LATER_WAITING = range(6)
"""Columns of what follows each number of a sequence: the length of the rest of its tour, from its place on; the worth
of the places of that rest, and their worth times the path to each; the longest of the later tours, their sum and
their waiting."""

_DOUBT = 1e-7
"""Estimates sum up in another order than costs: they are off by less than this share."""


@kernel(nrt=False)
def _look_ahead(sequence: Array, size: int, costs: _Costs, after: Array) -> None:
    """Write what follows each of the first ``size`` numbers of a sequence of all robots' tours."""
    robots, count = costs.first.shape
    robot = robots - 1
    for column in range(after.shape[1]):
        after[size, column] = 0.0
    for k in range(size - 1, -1, -1):
        here, behind, place = after[k], after[k + 1], sequence[k]
        goes_on = k + 1 < size and sequence[k + 1] < count
        for column in range(_REST, _LATER_LONGEST):
            here[column] = 0.0
        for column in range(_LATER_LONGEST, _LATER_WAITING + 1):
            here[column] = behind[column]
        if place < count:
            here[_WORTH] = costs.worth[place]
            if goes_on:
                leg = costs.between[place, sequence[k + 1]]
                here[_REST] = leg + behind[_REST]
                here[_WORTH] += behind[_WORTH]
                here[_WAITING] = behind[_WAITING] + leg * behind[_WORTH]
            continue
        if goes_on:
            leg = costs.first[robot, sequence[k + 1]]
            here[_LATER_LONGEST] = max(here[_LATER_LONGEST], leg + behind[_REST])
            here[_LATER_TOTAL] += leg + behind[_REST]
            here[_LATER_WAITING] += behind[_WAITING] + leg * behind[_WORTH]
        robot -= 1


@kernel(forceinline=True, nrt=False)
def _is_hopeless(
    state: _State, sequence: Array, first: int, size: int, costs: _Costs, after: Array, limit: float
) -> bool:
    """Whether tours that begin thus and go on with a sequence surely cost a limit or more, by an estimate."""
    here, length, waiting = after[first], state.length, state.waiting
    if first < size and sequence[first] < costs.first.shape[1]:
        place = sequence[first]
        length += costs.first[state.robot, place] if state.last < 0 else costs.between[state.last, place]
        waiting += here[_WAITING] + length * here[_WORTH]
        length += here[_REST]
    longest, weights = max(state.longest, length, here[_LATER_LONGEST]), costs.weights
    total = state.total + length + here[_LATER_TOTAL]
    waiting += here[_LATER_WAITING]
    cost = weights.longest * longest + weights.total * total + weights.waiting * waiting
    return bool(cost >= limit + _DOUBT * (1.0 + abs(cost)))


@kernel
def team_tours(
    first: NDArray[np.float64],
    between: NDArray[np.float64],
    worth: NDArray[np.float64],
    weights: TourWeights,
) -> NDArray[np.int64]:
    """Return the places that each robot of a team visits, in order: approximately the best open tours.

    Places are inserted one by one at the lowest cost, the cheapest first; then pieces are reversed (2-opt; Croes
    1958) and moved, within a tour or to another robot's (Or 1976), until neither helps.

    Parameters
    ----------
    first : (robots, n) float64
        Cost of the path from each robot to each place; finite.
    between : (n, n) float64
        Cost of the paths between places; finite.
    worth : (n,) float64
        Worth of each place.

    Returns
    -------
    (n + robots - 1,) int64
        Indices of places, robot after robot; n and above between the places of two robots.
    """
    robots, count = first.shape
    sequence = np.empty(count + robots - 1, np.int64)
    for robot in range(robots - 1):
        sequence[robot] = count + robot
    costs = _Costs(first, between, worth, weights, count == 0 or first.min() >= 0.0)
    after = np.empty((len(sequence) + 1, 6))
    _insert_all(sequence, np.ones(count, np.bool_), costs, after)
    rest, piece = np.empty_like(sequence), np.empty(_LONGEST_PIECE, np.int64)
    cost = _cost(sequence, len(sequence), first, between, worth, weights)
    while True:
        better = _turn_pieces(sequence, costs, cost, after)
        better = _move_pieces(sequence, rest, piece, costs, better, after)
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
    """Return the cost of tours [m]; parameters as in ``costs_of_firsts``."""
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
    """Return the extra cost of tours if a robot visits each place first, (n,).

    All other places keep their order. The extra cost may be 0 or less if places are equal, or tours are not the
    best ones.

    Parameters
    ----------
    sequence : (n + robots - 1,) int64
        The tours, as ``team_tours`` returns them.
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
    """Return tours past ``count`` places in which a robot visits one of them first.

    All other places keep their order. ``sequence`` (count + robots - 1,) int64 are the tours, as ``team_tours``
    returns them.
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


@kernel(nrt=False)
def _cost(sequence: Array, size: int, first: Array, between: Array, worth: Array, weights: TourWeights) -> float:
    """Return the cost of the tours of the first ``size`` numbers of a sequence."""
    costs = _Costs(first, between, worth, weights, False)
    return float(_total(_visit_all(_begin(), sequence, 0, size, costs, np.inf), weights))


@kernel(nrt=False)
def _insert_all(sequence: Array, is_left: Array, costs: _Costs, after: Array) -> None:
    """Insert all places into empty tours, each time the one with the lowest cost."""
    robots, count = costs.first.shape
    size = robots - 1
    for _ in range(count):
        minimum, chosen, at = np.inf, -1, 0
        _look_ahead(sequence, size, costs, after)
        for place in range(count):
            if not is_left[place]:
                continue
            before = _begin()
            for position in range(size + 1):
                limit, state = minimum - _LESS, _visit(before, place, costs)
                if not _is_hopeless(state, sequence, position, size, costs, after, limit):
                    cost = _total(_visit_all(state, sequence, position, size, costs, limit), costs.weights)
                    if cost < limit:
                        minimum, chosen, at = cost, place, position
                if position < size:
                    before = _visit(before, sequence[position], costs)
        for k in range(size, at, -1):
            sequence[k] = sequence[k - 1]
        sequence[at], is_left[chosen] = chosen, False
        size += 1


@kernel(nrt=False)
def _turn_pieces(sequence: Array, costs: _Costs, cost: float, after: Array) -> float:
    """Reverse every piece that makes the tours better; return their cost."""
    size = sequence.shape[0]
    before = _begin()
    _look_ahead(sequence, size, costs, after)
    for start in range(size):
        for end in range(start + 2, size + 1):
            state, limit = before, cost - _LESS
            for k in range(end - 1, start - 1, -1):
                state = _visit(state, sequence[k], costs)
                if _is_over(state, costs, limit):
                    break
            if _is_over(state, costs, limit) or _is_hopeless(state, sequence, end, size, costs, after, limit):
                continue
            better = _total(_visit_all(state, sequence, end, size, costs, limit), costs.weights)
            if better < limit:
                for k in range((end - start) // 2):
                    other = end - 1 - k
                    sequence[start + k], sequence[other] = sequence[other], sequence[start + k]
                cost = better
                _look_ahead(sequence, size, costs, after)
        before = _visit(before, sequence[start], costs)
    return cost


@kernel(nrt=False)
def _move_pieces(sequence: Array, rest: Array, piece: Array, costs: _Costs, cost: float, after: Array) -> float:
    """Move short pieces to positions that make the tours better; return their cost."""
    size = sequence.shape[0]
    for length in range(1, min(_LONGEST_PIECE, size - 1) + 1):
        for start in range(size - length + 1):
            left = size - length
            _copy(sequence, start, length, piece, 0)
            _copy(sequence, 0, start, rest, 0)
            _copy(sequence, start + length, left - start, rest, start)
            _look_ahead(rest, left, costs, after)
            before = _begin()
            for position in range(left + 1):
                limit = cost - _LESS
                state = _visit_all(before, piece, 0, length, costs, limit)
                is_over = _is_over(state, costs, limit)
                if not is_over and not _is_hopeless(state, rest, position, left, costs, after, limit):
                    better = _total(_visit_all(state, rest, position, left, costs, limit), costs.weights)
                    if better < limit:
                        _copy(rest, 0, position, sequence, 0)
                        _copy(piece, 0, length, sequence, position)
                        _copy(rest, position, left - position, sequence, position + length)
                        cost = better
                        break
                if position < left:
                    before = _visit(before, rest[position], costs)
    return cost


@kernel(forceinline=True, nrt=False)
def _copy(source: Array, first: int, count: int, target: Array, at: int) -> None:
    """Copy some numbers of a sequence to another one."""
    for k in range(count):
        target[at + k] = source[first + k]
