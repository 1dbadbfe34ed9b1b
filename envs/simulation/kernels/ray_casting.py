"""Laser scans by exact traversal of the world's cells.

Two casters give the same ranges. The *quadrant caster* jumps, from the ray's cell, to the border of the
largest free square that opens the way the ray goes; a byte per cell and quadrant tells its side. The *face
caster* draws the wall faces in reach into the beams, nearest first wins; it is the faster one where walls are
long and straight. Which one runs is decided for each pose by the number of faces in reach, so a scan depends
on the pose and the floor alone.

A ray ends where it enters a solid cell. A ray that runs exactly through a corner of the lattice enters the
cell beside it in x first.
"""

import math

import numpy as np

from lidarium.envs.simulation.kernels.arrays import (
    FACE_COUNT,
    FACE_START_COUNT,
    FACE_STARTS,
    FACE_TABLE,
    FLOOR_COLUMNS,
    FLOOR_ROWS,
    SQUARES,
    TILE_COLUMNS,
)
from lidarium.envs.simulation.kernels.face_casting import cast_by_faces
from lidarium.envs.simulation.kernels.ray_tables import TILE
from lidarium.mapping.grids.scan_geometry import beam_directions, beams_towards
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.views import bytes_at, int32_table_at

FACES, FACES_PER_BEAM = 300, 1.4
"""Most faces in reach for which the face caster runs, alone and for each beam.

A face costs the same whatever the number of beams, a beam that travels does not: the two casters took equal
time at about 550 faces with 180 beams and at 1,300 with 720, over drawn, generated and real floors. Both give
the same ranges. """

BUNDLE, INNER_BUNDLE = 32, 8
"""Numbers of neighbouring beams that travel together, outer and inner.

They do so for as long as free squares hold them all, first the larger bundle, then the smaller.
"""

INSIDE = 1e-7
"""Beams that travel together stop this far before the border of a square [cells]."""


@kernel(inline=True, borrowing=True)
def _quadrant(directions: Array, beam: int) -> int:
    """Quadrant that a beam looks into: 1 for leftwards plus 2 for downwards."""
    return (1 if directions[0, beam] < 0.0 else 0) + (2 if directions[1, beam] < 0.0 else 0)


@kernel(inline=True, borrowing=True)
def _travel(
    squares: Array,
    offset: int,
    columns: int,
    x: float,
    y: float,
    row: int,
    column: int,
    distance: float,
    directions: Array,
    beam: int,
    reach: float,
) -> float:
    """Return the distance at which one beam enters a solid cell [cells].

    The beam begins at a cell and at a distance along its path.
    """
    direction_x, direction_y = directions[0, beam], directions[1, beam]
    inverse_x, inverse_y = directions[2, beam], directions[3, beam]
    step_x = -1 if direction_x < 0.0 else 1
    step_y = -1 if direction_y < 0.0 else 1
    forward_x, forward_y = (1 + step_x) // 2, (1 + step_y) // 2
    while True:
        side = int(squares[offset + row * columns + column])
        if side == 0:
            return min(distance, reach)
        # The square spans `side` cells the way the ray goes; its far borders are the next candidates.
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
    squares: Array,
    offset: int,
    columns: int,
    x: float,
    y: float,
    directions: Array,
    first: int,
    last: int,
    distance: float,
    reach: float,
) -> float:
    """Return the distance up to which beams run through squares that hold them all.

    The beams ``first`` to ``last``, of one quadrant, begin at a given distance.

    The beams between the two outer ones lie within the box of these two at every distance. A square that
    opens from the box's nearest corner and holds the box is free for all, up to where the first of the outer
    beams leaves it.
    """
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
        if distance >= reach:
            return distance


@kernel(borrowing=True)
def _cast_by_squares(
    squares: Array,
    rows: int,
    columns: int,
    x: float,
    y: float,
    directions: Array,
    reach: float,
    ranges: Array,
) -> None:
    """Fill ``ranges`` [cells] with the distance to the first solid cell, or ``reach``."""
    plane = rows * columns
    beams = ranges.shape[0]
    for first in range(0, beams, BUNDLE):
        last = min(first + BUNDLE, beams) - 1
        together = 0.0
        quadrant = _quadrant(directions, first)
        is_bundle = quadrant == _quadrant(directions, last) and quadrant == _quadrant(
            directions, (first + last) // 2
        )
        if is_bundle:
            together = _travel_together(
                squares, quadrant * plane, columns, x, y, directions, first, last, 0.0, reach
            )
        for inner in range(first, last + 1, INNER_BUNDLE):
            inner_last = min(inner + INNER_BUNDLE - 1, last)
            distance = together
            if is_bundle and distance < reach:
                distance = _travel_together(
                    squares, quadrant * plane, columns, x, y, directions, inner, inner_last, together, reach
                )
            for beam in range(inner, inner_last + 1):
                if distance >= reach:
                    ranges[beam] = reach
                    continue
                if not is_bundle:
                    quadrant = _quadrant(directions, beam)
                column, row = int(x + distance * directions[0, beam]), int(y + distance * directions[1, beam])
                ranges[beam] = _travel(
                    squares, quadrant * plane, columns, x, y, row, column, distance, directions, beam, reach
                )


@kernel(borrowing=True)
def cast_scan(
    tables: Array,
    x: float,
    y: float,
    heading: float,
    angle_first: float,
    increment: float,
    directions: Array,
    reach: float,
    ranges: Array,
) -> None:
    """Fill ``ranges`` with the distances to the first solid cell along each beam.

    Parameters
    ----------
    tables : (8,) int64
        ``RayTables.addresses`` of the floor.
    x, y : float
        Position of the laser [cells].
    heading, angle_first, increment : float
        Heading of the robot, angle of the first beam against it, angle between beams [rad].
    directions : (4, beams) float64
        Unit vectors of the beams in the world's axes (x, y) and their inverses.
    reach : float
        Longest range [cells].
    ranges : (beams,) float64
        Result [cells]; ``reach`` where nothing is met.
    """
    rows, columns, tile_columns = tables[FLOOR_ROWS], tables[FLOOR_COLUMNS], tables[TILE_COLUMNS]
    starts = int32_table_at(tables[FACE_STARTS], 1, tables[FACE_START_COUNT])[0]
    window = (
        max(int(y - reach) // TILE, 0),
        min(int(y + reach), rows - 1) // TILE,
        max(int(x - reach) // TILE, 0),
        min(int(x + reach), columns - 1) // TILE,
    )
    in_reach = 0
    for tile_row in range(window[0], window[1] + 1):
        first = (tile_row * tile_columns + window[2]) * 4
        last = (tile_row * tile_columns + window[3]) * 4 + 4
        in_reach += starts[last] - starts[first]
    if in_reach <= FACES + FACES_PER_BEAM * ranges.shape[0]:
        faces = int32_table_at(tables[FACE_TABLE], tables[FACE_COUNT], 3)
        cast_by_faces(
            faces,
            starts,
            tile_columns,
            window,
            x,
            y,
            heading + angle_first,
            increment,
            directions,
            reach,
            ranges,
        )
    else:
        squares = bytes_at(tables[SQUARES], 4 * rows * columns)
        _cast_by_squares(squares, rows, columns, x, y, directions, reach, ranges)


@kernel(borrowing=True)
def cut_by_disc(
    x: float,
    y: float,
    heading: float,
    angle_first: float,
    increment: float,
    directions: Array,
    disc_x: float,
    disc_y: float,
    disc_radius: float,
    reach: float,
    ranges: Array,
) -> None:
    """Shorten the beams that meet a disc (another robot).

    Positions, radius and ranges in cells.
    """
    offset_x, offset_y = disc_x - x, disc_y - y
    squared = offset_x * offset_x + offset_y * offset_y
    gap = squared - disc_radius * disc_radius
    if gap <= 0.0 or squared > (reach + disc_radius) ** 2:
        return
    beams = ranges.shape[0]
    begin, count = beams_towards(offset_x, offset_y, disc_radius, heading, angle_first, increment)
    turn = 2.0 * math.pi / increment
    for lap in range(2):
        first = max(int(math.floor(begin - lap * turn)) - 1, 0)
        last = min(int(math.floor(begin - lap * turn + count)) + 2, beams - 1)
        for beam in range(first, last + 1):
            middle = offset_x * directions[0, beam] + offset_y * directions[1, beam]
            inside = middle * middle - gap
            if inside >= 0.0 and middle > 0.0:
                ranges[beam] = min(ranges[beam], middle - math.sqrt(inside))


@kernel
def cast_scans(
    tables: Array,
    poses: Array,
    unit_vectors: Array,
    angle_first: float,
    increment: float,
    reach: float,
    ranges: Array,
) -> None:
    """Cast a scan at each pose (x, y [cells], heading) of one floor.

    ``ranges`` (poses, beams) float64 [cells].
    """
    directions = np.empty((4, unit_vectors.shape[1]))
    for k in range(poses.shape[0]):
        beam_directions(poses[k, 2], unit_vectors, directions)
        cast_scan(
            tables,
            poses[k, 0],
            poses[k, 1],
            poses[k, 2],
            angle_first,
            increment,
            directions,
            reach,
            ranges[k],
        )
