"""Laser scans by travelling through the empty squares of a floor."""

from lidarium.mapping.grids.scan_geometry import Beams
from lidarium.mapping.kernels.compilation import Array, kernel

BUNDLE, INNER_BUNDLE = 32, 8
"""Numbers of neighbouring beams that travel together, outer and inner.

They do so for as long as free squares hold them all, first the larger bundle, then the smaller.
"""


INSIDE = 1e-7
"""Beams that travel together stop this far before the border of a square [cells]."""


@kernel(inline=True, borrowing=True)
def _quadrant(directions: Array, beam: int) -> int:
    """Return the quadrant of a beam's direction: 1 for leftwards plus 2 for downwards."""
    return (1 if directions[0, beam] < 0.0 else 0) + (2 if directions[1, beam] < 0.0 else 0)


@kernel(inline=True, borrowing=True)
def _travel(squares: Array, offset: int, columns: int, beams: Beams, beam: int, distance: float) -> float:
    """Return the distance at which one beam enters a solid cell [cells].

    It begins at a distance along its path up to which all cells are free.
    """
    x, y, directions, reach = beams.x, beams.y, beams.directions, beams.reach
    direction_x, direction_y = directions[0, beam], directions[1, beam]
    inverse_x, inverse_y = directions[2, beam], directions[3, beam]
    column, row = int(x + distance * direction_x), int(y + distance * direction_y)
    step_x = -1 if direction_x < 0.0 else 1
    step_y = -1 if direction_y < 0.0 else 1
    forward_x, forward_y = (1 + step_x) // 2, (1 + step_y) // 2
    while True:
        side = int(squares[offset + row * columns + column])
        if side == 0:
            return min(distance, reach)
        # The square spans `side` cells in the ray's direction; its far borders are the next candidates.
        distance_x = (column + forward_x + step_x * (side - 1) - x) * inverse_x
        distance_y = (row + forward_y + step_y * (side - 1) - y) * inverse_y
        # Along a lattice line rounding may put a border behind the ray; the ray itself never goes back.
        if distance_x <= distance_y:
            distance = max(distance, distance_x)
            if distance >= reach:
                return reach
            last_row = row + step_y * (side - 1)
            crossed = int(y + distance * direction_y)
            # Rounding at a lattice corner must never step back or out of the square: the loop would not end.
            row = min(max(crossed, row), last_row) if step_y > 0 else max(min(crossed, row), last_row)
            column += step_x * side
        else:
            distance = max(distance, distance_y)
            if distance >= reach:
                return reach
            last_column = column + step_x * (side - 1)
            crossed = int(x + distance * direction_x)
            column = (
                min(max(crossed, column), last_column)
                if step_x > 0
                else max(min(crossed, column), last_column)
            )
            row += step_y * side


@kernel(inline=True, borrowing=True)
def _travel_together(
    squares: Array, offset: int, columns: int, beams: Beams, first: int, last: int, distance: float
) -> float:
    """Return the distance up to which beams run through squares that hold them all.

    The beams ``first`` to ``last``, of one quadrant, begin at a given distance.

    The beams between the two outer ones lie within the box of these two at every distance. A square that
    opens from the box's nearest corner and holds the box is free for all, up to where the first of the outer
    beams leaves it.
    """
    x, y, directions = beams.x, beams.y, beams.directions
    first_x, first_y = directions[0, first], directions[1, first]
    last_x, last_y = directions[0, last], directions[1, last]
    step_x = -1 if first_x < 0.0 else 1
    step_y = -1 if first_y < 0.0 else 1
    forward_x, forward_y = (1 + step_x) // 2, (1 + step_y) // 2
    inverse_x = min(abs(directions[2, first]), abs(directions[2, last])) * step_x
    inverse_y = min(abs(directions[3, first]), abs(directions[3, last])) * step_y
    while True:
        column_a, column_b = int(x + distance * first_x), int(x + distance * last_x)
        row_a, row_b = int(y + distance * first_y), int(y + distance * last_y)
        column = min(column_a, column_b) if step_x > 0 else max(column_a, column_b)
        row = min(row_a, row_b) if step_y > 0 else max(row_a, row_b)
        side = int(squares[offset + row * columns + column])
        if side <= max(abs(column_b - column_a), abs(row_b - row_a)):
            return distance
        border_x = column + forward_x + step_x * (side - 1)
        border_y = row + forward_y + step_y * (side - 1)
        # A little less than the exit, so that every beam is inside the square for certain.
        leaving = min((border_x - x) * inverse_x, (border_y - y) * inverse_y) - INSIDE
        if leaving <= distance + 1.0:
            return distance
        distance = leaving
        if distance >= beams.reach:
            return distance


@kernel(borrowing=True)
def cast_by_squares(squares: Array, rows: int, columns: int, beams: Beams, ranges: Array) -> None:
    """Fill ``ranges`` [cells] with the distance to the first solid cell, or the reach."""
    plane, directions, reach = rows * columns, beams.directions, beams.reach
    for first in range(0, ranges.shape[0], BUNDLE):
        last = min(first + BUNDLE, ranges.shape[0]) - 1
        together = 0.0
        quadrant = _quadrant(directions, first)
        is_bundle = quadrant == _quadrant(directions, last) and quadrant == _quadrant(
            directions, (first + last) // 2
        )
        if is_bundle:
            together = _travel_together(squares, quadrant * plane, columns, beams, first, last, 0.0)
        for inner in range(first, last + 1, INNER_BUNDLE):
            inner_last = min(inner + INNER_BUNDLE - 1, last)
            distance = together
            if is_bundle and distance < reach:
                distance = _travel_together(
                    squares, quadrant * plane, columns, beams, inner, inner_last, together
                )
            for beam in range(inner, inner_last + 1):
                if distance >= reach:
                    ranges[beam] = reach
                    continue
                if not is_bundle:
                    quadrant = _quadrant(directions, beam)
                ranges[beam] = _travel(squares, quadrant * plane, columns, beams, beam, distance)
