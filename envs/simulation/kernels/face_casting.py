"""Laser scans by drawing the wall faces in reach into the beams.

The nearest face that a beam meets is its range.

Which beams a face can meet is found by a fast angle and rounded up to whole lanes of eight; whether each of
them meets it, and where, is exact.
"""

import math

import numpy as np

from lidarium.envs.simulation.kernels.ray_tables import TILE
from lidarium.mapping.grids.scan_geometry import fast_angle
from lidarium.mapping.kernels.beam_lanes import FLOAT, LANES, lower_lanes
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.views import scratch_grid, vector_at

CORNER_OVERLAP = 1e-9
"""Overlap of faces beyond their corners [cells].

It makes rounding leave no gap between two faces.
"""


@kernel(inline=True, borrowing=True)
def _draw_face(
    first: int,
    last: int,
    beams: int,
    distance: float,
    run: float,
    low: float,
    high: float,
    inverse: int,
    direction: int,
    ranges: int,
) -> None:
    """Lower the ranges of the beams that meet a face.

    The beams are those from ``first`` to ``last`` and some beside them.

    The face spans low to high along its run. Inverses and directions of the beams, and the ranges, are given
    by their addresses.
    """
    if first > last:
        return
    if beams < LANES:
        inverses, directions = vector_at(inverse, beams, np.float64), vector_at(direction, beams, np.float64)
        nearest = vector_at(ranges, beams, np.float64)
        for k in range(first, last + 1):
            candidate = distance * inverses[k]
            along = run + candidate * directions[k]
            if low <= along <= high and 0.0 < candidate < nearest[k]:
                nearest[k] = candidate
        return
    for beam in range(first, last + 1, LANES):
        offset = FLOAT * min(beam, beams - LANES)
        lower_lanes(inverse + offset, direction + offset, ranges + offset, distance, run, low, high)


@kernel(inline=True, borrowing=True)
def _list_faces(
    faces: Array,
    starts: Array,
    tile_columns: int,
    window: tuple[int, int, int, int],
    direction: int,
    fixed_own: float,
    run_own: float,
    reach: float,
    listed: Array,
) -> int:
    """List the faces of a direction that are in reach; return their number.

    They face the laser. For each, distance, low and high end are listed.

    Most branches on a single face could not be foreseen, so each is written down and counted if it is one.
    """
    forward = direction & 1 == 0
    sign = 1.0 if forward else -1.0
    count = np.uintp(0)
    for tile_row in range(window[0], window[1] + 1):
        for tile_column in range(window[2], window[3] + 1):
            # A tile that lies behind shows no face that looks this way.
            border = (tile_column if direction < 2 else tile_row) * TILE + (TILE if forward else 0)
            if forward != (border > fixed_own):
                continue
            group = (tile_row * tile_columns + tile_column) * 4 + direction
            for k in range(starts[group], starts[group + 1]):
                distance, low, high = faces[k, 0] - fixed_own, float(faces[k, 1]), float(faces[k, 2])
                sideways = max(0.0, max(low - run_own, run_own - high))
                listed[0, count], listed[1, count], listed[2, count] = distance, low, high
                is_near = distance * distance + sideways * sideways < reach * reach
                count += np.uintp((sign * distance > 0.0) & is_near)
    return int(count)


@kernel(inline=True, borrowing=True)
def _find_spans(
    listed: Array,
    count: int,
    run_own: float,
    along_rows: bool,
    forward: bool,
    first_angle: float,
    increment: float,
    beams: int,
    spans: Array,
) -> None:
    """Find the beams that may meet each of the listed faces.

    These are the first, the last, and the last from 0 on where they go on there (or -1).

    The fast angle is good to a hundredth of a beam: one more beam on each side holds all that meet the face.
    """
    beams_per_radian = 1.0 / increment
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
        firsts[k], lasts[k] = max(int(begin) - 1, 0), min(int(end) + 2, beams - 1)
        goes_on[k] = min(int(end - turn) + 2, beams - 1) if end + 3.0 >= turn else -1


@kernel(borrowing=True)
def cast_by_faces(
    faces: Array,
    starts: Array,
    tile_columns: int,
    window: tuple[int, int, int, int],
    x: float,
    y: float,
    first_angle: float,
    increment: float,
    directions: Array,
    reach: float,
    ranges: Array,
) -> None:
    """Fill ``ranges`` [cells] from the faces of the tiles in ``window``.

    Parameters
    ----------
    faces, starts : (F, 3) int32, (tiles * 4 + 1,) int32
        ``RayTables.faces`` and ``RayTables.face_starts``.
    tile_columns : int
        Tiles in a row of tiles.
    window : tuple of int
        row_low, row_high, column_low, column_high of the tiles in reach, high ends included.
    x, y, reach : float
        Position of the laser and longest range [cells].
    first_angle, increment : float
        Angle of the first beam in the world's axes, and between two [rad].
    directions : (4, beams) float64
        Unit vectors of the beams in the world's axes (x, y) and their inverses.
    ranges : (beams,) float64
        Result; ``reach`` where nothing is met.
    """
    beams = ranges.shape[0]
    for beam in range(beams):
        ranges[beam] = reach
    ranges_at, directions_at, row_size = ranges.ctypes.data, directions.ctypes.data, FLOAT * beams
    most = 0
    for tile_row in range(window[0], window[1] + 1):
        first_group = (tile_row * tile_columns + window[2]) * 4
        most += starts[first_group + 4 * (window[3] - window[2] + 1)] - starts[first_group]
    # One more than there can be: each candidate is written down before it is known whether it counts.
    listed, spans = scratch_grid(3, most + 1, np.float64), scratch_grid(3, most + 1, np.int64)
    for direction in range(4):
        along_rows, forward = direction < 2, direction & 1 == 0
        fixed_own, run_own = (x, y) if along_rows else (y, x)
        count = _list_faces(faces, starts, tile_columns, window, direction, fixed_own, run_own, reach, listed)
        _find_spans(listed, count, run_own, along_rows, forward, first_angle, increment, beams, spans)
        inverse = directions_at + (2 if along_rows else 3) * row_size
        other = directions_at + (1 if along_rows else 0) * row_size
        for k in range(count):
            distance, low, high = listed[0, k], listed[1, k] - CORNER_OVERLAP, listed[2, k] + CORNER_OVERLAP
            _draw_face(
                spans[0, k], spans[1, k], beams, distance, run_own, low, high, inverse, other, ranges_at
            )
            if spans[2, k] >= 0:
                _draw_face(0, spans[2, k], beams, distance, run_own, low, high, inverse, other, ranges_at)
