"""Laser scans by exact traversal of the world's cells.

Two casters give the same ranges. The *quadrant caster* jumps, from the ray's cell, to the border of the
largest free square that opens in the ray's direction; a byte per cell and quadrant holds its side. The *face
caster* draws the wall faces in reach into the beams, nearest first wins; it is faster if walls are
long and straight. Which one runs is decided for each pose by the number of faces in reach, so a scan depends
on the pose and the floor alone.

A ray ends as soon as it enters a solid cell. A ray that runs exactly through a corner of the lattice enters the
cell next to it in x first.
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
from lidarium.envs.simulation.kernels.face_casting import FaceTable, cast_by_faces
from lidarium.envs.simulation.kernels.ray_tables import TILE
from lidarium.mapping.grids.scan_geometry import Beams, beam_directions, beams_towards
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.llvm import HAS_GATHERS
from lidarium.mapping.kernels.simd.rays import FLOAT, GROUP, RAYS, travel_bundles, travel_rays
from lidarium.mapping.kernels.views import grid_at, scratch_grid, scratch_vector, vector_at

BUNDLE = GROUP
"""Number of neighbouring beams that travel together as long as free squares hold them all."""

INSIDE = 1e-7
"""Beams that travel together stop this far before the border of a square [cells]."""

MOST_PLACES = 2**31
"""Squares of a table that numbers of 32 bits count."""


@kernel(forceinline=True, nrt=False)
def _quadrant(directions: Array, beam: int) -> int:
    """Return the quadrant of a beam's direction: 1 for leftwards plus 2 for downwards."""
    return (1 if directions[0, beam] < 0.0 else 0) + (2 if directions[1, beam] < 0.0 else 0)


@kernel(forceinline=True, nrt=False)
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
            column = min(max(crossed, column), last_column) if step_x > 0 else max(min(crossed, column), last_column)
            row += step_y * side


@kernel(forceinline=True, nrt=False)
def _travel_together(squares: Array, offset: int, columns: int, beams: Beams, first: int, last: int) -> float:
    """Return the distance up to which beams run through squares that hold them all.

    The beams are those from ``first`` to ``last``, of one quadrant.

    The beams between the two outer ones lie within the box of these two at every distance. A square that opens from
    the box's nearest corner and holds the box is free for all, until the first of the outer beams leaves it.
    """
    x, y, directions = beams.x, beams.y, beams.directions
    first_x, first_y = directions[0, first], directions[1, first]
    last_x, last_y = directions[0, last], directions[1, last]
    step_x = -1 if first_x < 0.0 else 1
    step_y = -1 if first_y < 0.0 else 1
    forward_x, forward_y = (1 + step_x) // 2, (1 + step_y) // 2
    inverse_x = min(abs(directions[2, first]), abs(directions[2, last])) * step_x
    inverse_y = min(abs(directions[3, first]), abs(directions[3, last])) * step_y
    distance = 0.0
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
        leaving: float = min((border_x - x) * inverse_x, (border_y - y) * inverse_y) - INSIDE
        if leaving <= distance + 1.0:
            return distance
        distance = leaving
        if distance >= beams.reach:
            return distance


@kernel(forceinline=True, nrt=False)
def _is_bundle(directions: Array, first: int, last: int) -> bool:
    """Whether the beams from the first to the last are of one quadrant."""
    quadrant = _quadrant(directions, first)
    middle, end = _quadrant(directions, (first + last) // 2), _quadrant(directions, last)
    is_one: bool = quadrant == middle and quadrant == end
    return is_one


@kernel(nrt=False)
def cast_one_by_one(squares: Array, rows: int, columns: int, beams: Beams, ranges: Array) -> None:
    """Fill ``ranges`` as ``cast_by_squares`` does, beam by beam."""
    plane, directions = rows * columns, beams.directions
    for first in range(0, ranges.shape[0], BUNDLE):
        last = min(first + BUNDLE, ranges.shape[0]) - 1
        together = 0.0
        if _is_bundle(directions, first, last):
            offset = _quadrant(directions, first) * plane
            together = _travel_together(squares, offset, columns, beams, first, last)
        for beam in range(first, last + 1):
            if together >= beams.reach:
                ranges[beam] = beams.reach
            else:
                offset = _quadrant(directions, beam) * plane
                ranges[beam] = _travel(squares, offset, columns, beams, beam, together)


@kernel(forceinline=True, nrt=False)
def _list_bundles(beams: Beams, count: int, listed: Array) -> None:
    """List the parameters of ``travel_bundles`` for each bundle of a scan of ``count`` beams.

    Unused bundles stay at their start: their next border is at no distance.
    """
    directions = beams.directions
    for bundle in range(listed.shape[1]):
        first, last = bundle * BUNDLE, min(bundle * BUNDLE + BUNDLE, count) - 1
        if first < count and _is_bundle(directions, first, last):
            for axis in range(2):
                step = -1 if directions[axis, first] < 0.0 else 1
                listed[axis, bundle], listed[2 + axis, bundle] = (
                    directions[axis, first],
                    directions[axis, last],
                )
                inverse = min(abs(directions[2 + axis, first]), abs(directions[2 + axis, last]))
                listed[4 + axis, bundle] = inverse * step
        else:
            for row in range(6):
                listed[row, bundle] = 0.0


@kernel(nrt=False)
def cast_in_lanes(squares: Array, rows: int, columns: int, beams: Beams, ranges: Array) -> None:
    """Fill ``ranges`` as ``cast_by_squares`` does, 32 beams at once: at least that many."""
    count, table, shape = ranges.shape[0], squares.ctypes.data, (rows * columns, columns)
    origin = (beams.x, beams.y, beams.reach)
    width = (count + BUNDLE * RAYS - 1) // (BUNDLE * RAYS) * RAYS
    bundles = scratch_grid(7, width, np.float64)
    _list_bundles(beams, count, bundles)
    for first in range(0, width, RAYS):
        address = bundles.ctypes.data + FLOAT * first
        travel_bundles(table, shape, origin, INSIDE, address, FLOAT * width)
    together, whole = bundles.ctypes.data + 6 * FLOAT * width, count // RAYS * RAYS
    directions, ranges_at = beams.directions.ctypes.data, ranges.ctypes.data
    for first in range(0, whole, RAYS):
        offset = FLOAT * first
        starts = together + offset // BUNDLE
        travel_rays(table, shape, origin, starts, directions + offset, FLOAT * count, ranges_at + offset)
    if whole == count:
        return
    # The last beams get lanes of their own, filled up with the very last.
    others, ends = scratch_grid(4, RAYS, np.float64), scratch_vector(RAYS, np.float64)
    for lane in range(RAYS):
        beam = min(whole + lane, count - 1)
        for row in range(4):
            others[row, lane] = beams.directions[row, beam]
    starts = together + FLOAT * (whole // BUNDLE)
    travel_rays(table, shape, origin, starts, others.ctypes.data, FLOAT * RAYS, ends.ctypes.data)
    for beam in range(whole, count):
        ranges[beam] = ends[beam - whole]


@kernel(nrt=False)
def cast_by_squares(squares: Array, rows: int, columns: int, beams: Beams, ranges: Array) -> None:
    """Fill ``ranges`` [cells] with the distance to the first solid cell, or the reach."""
    if HAS_GATHERS and ranges.shape[0] >= RAYS and squares.shape[0] < MOST_PLACES:
        cast_in_lanes(squares, rows, columns, beams, ranges)
    else:
        cast_one_by_one(squares, rows, columns, beams, ranges)


FACES, FACES_PER_BEAM = 300, 1.4
"""Maximum number of faces in reach for which the face caster runs, alone and for each beam.

The cost of a face is independent of the number of beams, the cost of travelling beams is not: the two casters took
equal time at about 550 faces with 180 beams and at 1,300 with 720, over drawn, generated and real floors. Both give
the same ranges. """


@kernel(nrt=False)
def cast_scan(tables: Array, beams: Beams, ranges: Array) -> None:
    """Fill ``ranges`` with the distances to the first solid cell along each beam.

    Parameters
    ----------
    tables : (8,) int64
        ``RayTables.addresses`` of the floor.
    ranges : (beams,) float64
        Result [cells]; the reach if nothing is met.
    """
    x, y, reach = beams.x, beams.y, beams.reach
    rows, columns, tile_columns = tables[FLOOR_ROWS], tables[FLOOR_COLUMNS], tables[TILE_COLUMNS]
    starts = grid_at(tables[FACE_STARTS], 1, tables[FACE_START_COUNT], np.int32)[0]
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
        faces = grid_at(tables[FACE_TABLE], tables[FACE_COUNT], 3, np.int32)
        cast_by_faces(FaceTable(faces, starts, tile_columns), window, beams, ranges)
    else:
        squares = vector_at(tables[SQUARES], 4 * rows * columns, np.uint8)
        cast_by_squares(squares, rows, columns, beams, ranges)


@kernel(nrt=False)
def cut_by_disc(
    beams: Beams,
    disc_x: float,
    disc_y: float,
    disc_radius: float,
    ranges: Array,
    marks: Array | None = None,
    mark: int = 0,
) -> bool:
    """Shorten the beams that meet a disc (a robot or a person), and return whether it shortens any.

    ``marks`` (beams,), if given, are set for these beams. Positions, radius and ranges in cells.
    """
    directions, increment = beams.directions, beams.increment
    offset_x, offset_y = disc_x - beams.x, disc_y - beams.y
    squared = offset_x * offset_x + offset_y * offset_y
    gap, is_met = squared - disc_radius * disc_radius, False
    if gap <= 0.0 or squared > (beams.reach + disc_radius) ** 2:
        return False
    begin, count = beams_towards(offset_x, offset_y, disc_radius, beams.heading, beams.angle_first, increment)
    turn = 2.0 * math.pi / increment
    for lap in range(2):
        first = max(int(math.floor(begin - lap * turn)) - 1, 0)
        last = min(int(math.floor(begin - lap * turn + count)) + 2, ranges.shape[0] - 1)
        for beam in range(first, last + 1):
            middle = offset_x * directions[0, beam] + offset_y * directions[1, beam]
            inside = middle * middle - gap
            if inside >= 0.0 and middle > 0.0 and middle - math.sqrt(inside) < ranges[beam]:
                ranges[beam], is_met = middle - math.sqrt(inside), True
                if marks is not None:
                    marks[beam] = mark
    return is_met


@kernel(nrt=False)
def cut_by_segment(
    beams: Beams, from_x: float, from_y: float, to_x: float, to_y: float, ranges: Array, marks: Array, mark: int
) -> None:
    """Shorten the beams that meet a segment (the leaf of a door), and set their ``marks`` (beams,).

    Positions and ranges in cells.
    """
    directions, increment = beams.directions, beams.increment
    middle_x, middle_y = 0.5 * (from_x + to_x) - beams.x, 0.5 * (from_y + to_y) - beams.y
    half = 0.5 * math.hypot(to_x - from_x, to_y - from_y)
    if middle_x * middle_x + middle_y * middle_y > (beams.reach + half) ** 2:
        return
    begin, count = beams_towards(middle_x, middle_y, half, beams.heading, beams.angle_first, increment)
    offset_x, offset_y = from_x - beams.x, from_y - beams.y
    along_x, along_y = to_x - from_x, to_y - from_y
    turn = 2.0 * math.pi / increment
    for lap in range(2):
        first = max(int(math.floor(begin - lap * turn)) - 1, 0)
        last = min(int(math.floor(begin - lap * turn + count)) + 2, ranges.shape[0] - 1)
        for beam in range(first, last + 1):
            direction_x, direction_y = directions[0, beam], directions[1, beam]
            across = direction_x * along_y - direction_y * along_x
            if across == 0.0:
                continue
            distance = (offset_x * along_y - offset_y * along_x) / across
            place = (offset_x * direction_y - offset_y * direction_x) / across
            if 0.0 <= place <= 1.0 and 0.0 < distance < ranges[beam]:
                ranges[beam] = distance
                marks[beam] = mark


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
        beams = Beams(poses[k, 0], poses[k, 1], poses[k, 2], angle_first, increment, directions, reach)
        cast_scan(tables, beams, ranges[k])
