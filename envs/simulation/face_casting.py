"""Laser scans by drawing the wall faces in reach into the beams: the nearest face that a beam meets is its range.

Which beams a face can meet is found by a fast angle and rounded up to whole lanes of eight; whether each of them meets it, and
where, is exact.
"""

import math
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from lidarium.envs.simulation.ray_tables import TILE
from lidarium.mapping.kernels import Array, kernel, vector_at
from lidarium.mapping.scans import fast_angle

CORNER_OVERLAP = 1e-9
"""Faces reach this far beyond their corners, so that rounding leaves no gap between two of them [cells]."""

LANES = 8
"""Beams into which a face is drawn at once."""

_FLOAT = 8
"""Bytes of a float64."""

_BEAMS = ir.VectorType(ir.DoubleType(), LANES)


def _lower_lanes(
    typing_context: Any, inverses: Any, directions: Any, ranges: Any, distance: Any, run: Any, low: Any, high: Any  # noqa: ANN401
) -> Any:  # fmt: skip # noqa: ANN401
    """Lower the ranges of the beams in the lanes that meet a face."""

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:  # noqa: ANN401
        places = ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES)
        nothing, zero = ir.Constant(_BEAMS, ir.Undefined), ir.Constant(_BEAMS, [0.0] * LANES)

        def spread(value: Any) -> Any:  # noqa: ANN401
            first = builder.insert_element(nothing, value, ir.Constant(ir.IntType(32), 0))
            return builder.shuffle_vector(first, nothing, places)

        inverse_at, direction_at, range_at = (builder.inttoptr(address, _BEAMS.as_pointer()) for address in arguments[:3])
        distances, runs, lows, highs = (spread(value) for value in arguments[3:])
        nearest = builder.load(range_at, align=_FLOAT)
        candidates = builder.fmul(distances, builder.load(inverse_at, align=_FLOAT))
        along = builder.fadd(runs, builder.fmul(candidates, builder.load(direction_at, align=_FLOAT)))
        is_met = builder.and_(
            builder.and_(builder.fcmp_ordered("<=", lows, along), builder.fcmp_ordered("<=", along, highs)),
            builder.and_(builder.fcmp_ordered(">", candidates, zero), builder.fcmp_ordered("<", candidates, nearest)),
        )
        builder.store(builder.select(is_met, candidates, nearest), range_at, align=_FLOAT)

    return types.void(*(types.int64,) * 3, *(types.float64,) * 4), generate


_lower: Any = intrinsic(_lower_lanes)


@kernel(inline=True)
def _draw_face(
    first: int, last: int, beams: int, distance: float, run: float, low: float, high: float, inverse: int, direction: int, ranges: int
) -> None:
    """Lower the ranges of those beams from ``first`` to ``last``, and of some beside them, that meet a face.

    The face spans low to high along its run. Inverses and directions of the beams, and the ranges, are given by their addresses.
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
        offset = _FLOAT * min(beam, beams - LANES)
        _lower(inverse + offset, direction + offset, ranges + offset, distance, run, low, high)


@kernel
def cast_by_faces(
    faces: Array, starts: Array, tile_columns: int, window: tuple[int, int, int, int], x: float, y: float, first_angle: float,
    increment: float, directions: Array, reach: float, ranges: Array,
) -> None:  # fmt: skip
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
    ranges_at, directions_at, row_size = ranges.ctypes.data, directions.ctypes.data, _FLOAT * beams
    beams_per_radian = 1.0 / increment
    turn = 2.0 * math.pi * beams_per_radian
    turns_per_beam = 1.0 / turn
    for tile_row in range(window[0], window[1] + 1):
        for tile_column in range(window[2], window[3] + 1):
            group = (tile_row * tile_columns + tile_column) * 4
            for direction in range(4):
                along_rows = direction < 2
                forward = direction & 1 == 0
                fixed_own, run_own = (x, y) if along_rows else (y, x)
                # A tile that lies behind shows no face that looks this way.
                border = (tile_column if along_rows else tile_row) * TILE + (TILE if forward else 0)
                if forward != (border > fixed_own):
                    continue
                inverse = directions_at + (2 if along_rows else 3) * row_size
                other = directions_at + (1 if along_rows else 0) * row_size
                for k in range(starts[group + direction], starts[group + direction + 1]):
                    distance = faces[k, 0] - fixed_own
                    if forward != (distance > 0.0) or abs(distance) >= reach:
                        continue
                    low, high = float(faces[k, 1]), float(faces[k, 2])
                    sideways = max(0.0, max(low - run_own, run_own - high))
                    if distance * distance + sideways * sideways >= reach * reach:
                        continue
                    if along_rows:
                        angle_low, angle_high = fast_angle(low - y, distance), fast_angle(high - y, distance)
                    else:
                        angle_low, angle_high = fast_angle(distance, low - x), fast_angle(distance, high - x)
                    # Seen from inside, the low end is the clockwise one on the right and below.
                    if forward != along_rows:
                        angle_low, angle_high = angle_high, angle_low
                    span = angle_high - angle_low
                    if span < 0.0:
                        span += 2.0 * math.pi
                    begin = (angle_low - first_angle) * beams_per_radian
                    begin -= turn * math.floor(begin * turns_per_beam)
                    count = span * beams_per_radian
                    low -= CORNER_OVERLAP
                    high += CORNER_OVERLAP
                    # The fast angle is good to a hundredth of a beam: one more beam on each side holds all that meet the face.
                    for lap in range(2):
                        start = begin - lap * turn
                        first, last = max(int(start) - 1, 0), min(int(start + count) + 2, beams - 1)
                        _draw_face(first, last, beams, distance, run_own, low, high, inverse, other, ranges_at)
                        if begin + count + 3.0 < turn:
                            break
