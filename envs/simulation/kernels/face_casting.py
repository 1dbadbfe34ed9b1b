"""Laser scans by drawing the wall faces in reach into the beams.

The nearest face that a beam meets is its range.

Which beams a face can meet is found by a fast angle and rounded up to whole lanes of eight; whether each of
them meets it, and at which distance, is exact.
"""

import math
from typing import NamedTuple

import numpy as np

from lidarium.envs.simulation.kernels.ray_tables import TILE
from lidarium.mapping.grids.scan_geometry import Beams, fast_angle
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.simd.faces import BEAMS, FLOAT, lower_ranges
from lidarium.mapping.kernels.views import scratch_grid, vector_at

CORNER_OVERLAP = 1e-9
"""Overlap of faces beyond their corners [cells].

It makes rounding leave no gap between two faces.
"""


class FaceTable(NamedTuple):
    """The wall faces of a floor, tile by tile.

    Attributes
    ----------
    faces, starts : (F, 3) int32, (tiles * 4 + 1,) int32
        ``RayTables.faces`` and ``RayTables.face_starts``.
    tile_columns : int
        Tiles in a row of tiles.
    """

    faces: Array
    starts: Array
    tile_columns: int


class _BeamRows(NamedTuple):
    """Rows of numbers, one for each beam, by their addresses.

    Attributes
    ----------
    beams : int
        Number of beams.
    inverses, directions : int
        Inverse of the beams' component across the faces of one direction, and their component along them.
    ranges : int
        The ranges that are lowered [cells].
    """

    beams: int
    inverses: int
    directions: int
    ranges: int


@kernel(forceinline=True, nrt=False)
def _draw_face(first: int, last: int, rows: _BeamRows, distance: float, run: float, low: float, high: float) -> None:
    """Lower the ranges of the beams that meet a face.

    The beams are those from ``first`` to ``last`` and a few next to them. The face spans low to high along its run.
    """
    if first > last:
        return
    beams = rows.beams
    if beams < BEAMS:
        inverses = vector_at(rows.inverses, beams, np.float64)
        directions = vector_at(rows.directions, beams, np.float64)
        nearest = vector_at(rows.ranges, beams, np.float64)
        for k in range(first, last + 1):
            candidate = distance * inverses[k]
            along = run + candidate * directions[k]
            if low <= along <= high and 0.0 < candidate < nearest[k]:
                nearest[k] = candidate
        return
    for beam in range(first, last + 1, BEAMS):
        offset = FLOAT * min(beam, beams - BEAMS)
        inverse, direction, ranges = rows.inverses + offset, rows.directions + offset, rows.ranges + offset
        lower_ranges(inverse, direction, ranges, distance, run, low, high)


@kernel(forceinline=True, nrt=False)
def _list_faces(
    table: FaceTable, window: tuple[int, int, int, int], direction: int, beams: Beams, listed: Array
) -> int:
    """List the faces of a direction that are in reach; return their number.

    They face the laser. For each, distance, low and high end are listed.

    A branch for each face would often be mispredicted, so every face is written, and counted only if it is in reach.
    """
    faces, starts, reach = table.faces, table.starts, beams.reach
    forward = direction & 1 == 0
    fixed_own, run_own = (beams.x, beams.y) if direction < 2 else (beams.y, beams.x)
    sign = 1.0 if forward else -1.0
    count = np.uintp(0)
    for tile_row in range(window[0], window[1] + 1):
        for tile_column in range(window[2], window[3] + 1):
            # A tile that lies behind shows no face of this direction.
            border = (tile_column if direction < 2 else tile_row) * TILE + (TILE if forward else 0)
            if forward != (border > fixed_own):
                continue
            group = (tile_row * table.tile_columns + tile_column) * 4 + direction
            for k in range(starts[group], starts[group + 1]):
                distance, low, high = faces[k, 0] - fixed_own, float(faces[k, 1]), float(faces[k, 2])
                sideways = max(0.0, max(low - run_own, run_own - high))
                listed[0, count], listed[1, count], listed[2, count] = distance, low, high
                is_near = distance * distance + sideways * sideways < reach * reach
                count += np.uintp((sign * distance > 0.0) & is_near)
    return int(count)


@kernel(forceinline=True, nrt=False)
def _find_spans(listed: Array, count: int, direction: int, beams: Beams, spans: Array) -> None:
    """Find the beams that may meet each of the listed faces.

    These are the first, the last, and the last of those that continue from beam 0 (or -1).

    The fast angle is good to a hundredth of a beam: one more beam on each side holds all that meet the face.
    """
    along_rows, forward = direction < 2, direction & 1 == 0
    run_own, last_beam = beams.y if along_rows else beams.x, beams.directions.shape[1] - 1
    first_angle = beams.heading + beams.angle_first
    beams_per_radian = 1.0 / beams.increment
    turn = 2.0 * math.pi * beams_per_radian
    turns_per_beam = 1.0 / turn
    # Seen from inside, the low end is the clockwise one on the right and below.
    begins, ends = (1, 2) if forward == along_rows else (2, 1)
    distances, begin_at, end_at = listed[0], listed[begins], listed[ends]
    firsts, lasts, goes_on = spans[0], spans[1], spans[2]
    for k in range(count):
        begin_run, end_run, distance = begin_at[k] - run_own, end_at[k] - run_own, distances[k]
        if along_rows:
            angle, angle_end = fast_angle(begin_run, distance), fast_angle(end_run, distance)
        else:
            angle, angle_end = fast_angle(distance, begin_run), fast_angle(distance, end_run)
        span = angle_end - angle
        span += 2.0 * math.pi if span < 0.0 else 0.0
        begin = (angle - first_angle) * beams_per_radian
        begin -= turn * math.floor(begin * turns_per_beam)
        end = begin + span * beams_per_radian
        firsts[k], lasts[k] = max(int(begin) - 1, 0), min(int(end) + 2, last_beam)
        goes_on[k] = min(int(end - turn) + 2, last_beam) if end + 3.0 >= turn else -1


@kernel(nrt=False)
def cast_by_faces(table: FaceTable, window: tuple[int, int, int, int], beams: Beams, ranges: Array) -> None:
    """Fill ``ranges`` [cells] from the faces of the tiles in ``window``.

    Parameters
    ----------
    ranges : (beams,) float64
        Result; the reach if nothing is met.
    """
    starts, count_of_beams = table.starts, ranges.shape[0]
    for beam in range(count_of_beams):
        ranges[beam] = beams.reach
    ranges_at, directions_at, row_size = (
        ranges.ctypes.data,
        beams.directions.ctypes.data,
        FLOAT * count_of_beams,
    )
    most = 0
    for tile_row in range(window[0], window[1] + 1):
        first_group = (tile_row * table.tile_columns + window[2]) * 4
        most += starts[first_group + 4 * (window[3] - window[2] + 1)] - starts[first_group]
    # One more than there can be: each candidate is written down before it is known whether it counts.
    listed, spans = scratch_grid(3, most + 1, np.float64), scratch_grid(3, most + 1, np.int64)
    for direction in range(4):
        along_rows = direction < 2
        run = beams.y if along_rows else beams.x
        count = _list_faces(table, window, direction, beams, listed)
        _find_spans(listed, count, direction, beams, spans)
        across = directions_at + (2 if along_rows else 3) * row_size
        along = directions_at + (1 if along_rows else 0) * row_size
        rows = _BeamRows(count_of_beams, across, along, ranges_at)
        for k in range(count):
            distance, low, high = listed[0, k], listed[1, k] - CORNER_OVERLAP, listed[2, k] + CORNER_OVERLAP
            _draw_face(spans[0, k], spans[1, k], rows, distance, run, low, high)
            if spans[2, k] >= 0:
                _draw_face(0, spans[2, k], rows, distance, run, low, high)
