"""Laser scans by exact traversal of the world's cells.

Two casters give the same ranges. The *quadrant caster* jumps, from the ray's cell, to the border of the
largest free square that opens in the ray's direction; a byte per cell and quadrant holds its side. The *face
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
from lidarium.envs.simulation.kernels.face_casting import FaceTable, cast_by_faces
from lidarium.envs.simulation.kernels.ray_tables import TILE
from lidarium.envs.simulation.kernels.ray_travel import cast_by_squares
from lidarium.mapping.grids.scan_geometry import Beams, beam_directions, beams_towards
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.views import grid_at, vector_at

FACES, FACES_PER_BEAM = 300, 1.4
"""Most faces in reach for which the face caster runs, alone and for each beam.

A face costs the same whatever the number of beams, a beam that travels does not: the two casters took equal
time at about 550 faces with 180 beams and at 1,300 with 720, over drawn, generated and real floors. Both give
the same ranges. """


@kernel(nrt=False)
def cast_scan(tables: Array, beams: Beams, ranges: Array) -> None:
    """Fill ``ranges`` with the distances to the first solid cell along each beam.

    Parameters
    ----------
    tables : (8,) int64
        ``RayTables.addresses`` of the floor.
    beams : Beams
        Of the scan, in the floor's cells.
    ranges : (beams,) float64
        Result [cells]; the reach where nothing is met.
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
def cut_by_disc(beams: Beams, disc_x: float, disc_y: float, disc_radius: float, ranges: Array) -> None:
    """Shorten the beams that meet a disc (another robot).

    Positions, radius and ranges in cells.
    """
    directions, increment = beams.directions, beams.increment
    offset_x, offset_y = disc_x - beams.x, disc_y - beams.y
    squared = offset_x * offset_x + offset_y * offset_y
    gap = squared - disc_radius * disc_radius
    if gap <= 0.0 or squared > (beams.reach + disc_radius) ** 2:
        return
    begin, count = beams_towards(offset_x, offset_y, disc_radius, beams.heading, beams.angle_first, increment)
    turn = 2.0 * math.pi / increment
    for lap in range(2):
        first = max(int(math.floor(begin - lap * turn)) - 1, 0)
        last = min(int(math.floor(begin - lap * turn + count)) + 2, ranges.shape[0] - 1)
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
        beams = Beams(poses[k, 0], poses[k, 1], poses[k, 2], angle_first, increment, directions, reach)
        cast_scan(tables, beams, ranges[k])
