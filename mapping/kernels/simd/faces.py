"""Drawing a face: ranges of eight beams, or inverse depths of sixteen pixels, at once."""

import numpy as np
from llvmlite import ir
from numba import types

from lidarium.mapping.kernels.llvm import (
    INT,
    Builder,
    Value,
    call,
    constant,
    lanewise,
    llvm_overload,
    load_at,
    splat,
    store_at,
    vector,
)
from lidarium.mapping.kernels.views import vector_at

BEAMS = 8
"""Beams into which a face is drawn at once."""

PIXELS = 16
"""Pixels into which a face is drawn at once."""

LINES = 8
"""Scan lines of which the columns within a face are found at once."""

OVERLAP = 1e-7
"""Overlap of faces beyond their edges, so that rounding leaves no gap between two [pixels]."""

FLOAT, WORD = 8, 4
"""Bytes of a float64 and of an int32."""

_BEAMS = vector(ir.DoubleType(), BEAMS)
_LINES = vector(ir.DoubleType(), LINES)
_PIXELS, _INDICES = vector(ir.FloatType(), PIXELS), vector(INT, PIXELS)


def lower_ranges(
    inverses: int, directions: int, ranges: int, distance: float, run: float, low: float, high: float
) -> None:
    """Lower the ranges (8,) float64 of beams that meet a face at ``distance`` between low and high."""
    nearest = vector_at(ranges, BEAMS, np.float64)
    candidates = distance * np.array(vector_at(inverses, BEAMS, np.float64))
    along = run + candidates * np.array(vector_at(directions, BEAMS, np.float64))
    is_met = (low <= along) & (along <= high) & (candidates > 0.0) & (candidates < nearest)
    nearest[:] = np.where(is_met, candidates, nearest)


@llvm_overload(lower_ranges, types.void, *(types.int64,) * 3, *(types.float64,) * 4)
def _(
    builder: Builder,
    inverses: Value,
    directions: Value,
    ranges: Value,
    distance: Value,
    run: Value,
    low: Value,
    high: Value,
) -> Value:
    distance, run, low, high = (splat(builder, value, _BEAMS) for value in (distance, run, low, high))
    nearest = load_at(builder, ranges, _BEAMS)
    candidates = builder.fmul(distance, load_at(builder, inverses, _BEAMS))
    along = builder.fadd(run, builder.fmul(candidates, load_at(builder, directions, _BEAMS)))
    is_within = builder.and_(builder.fcmp_ordered("<=", low, along), builder.fcmp_ordered("<=", along, high))
    is_ahead = builder.fcmp_ordered(">", candidates, constant(_BEAMS, 0.0))
    is_nearer = builder.and_(is_ahead, builder.fcmp_ordered("<", candidates, nearest))
    is_met = builder.and_(is_within, is_nearer)
    store_at(builder, builder.select(is_met, candidates, nearest), ranges)


def raise_pixels(address: int, start: np.float32, slope: np.float32, first: int, last: int) -> None:
    """Raise the 16 float32 pixels from index ``first`` to ``last`` to at least ``start + slope * index``.

    No pixel is negative.
    """
    pixels, indices = vector_at(address, PIXELS, np.float32), np.arange(PIXELS)
    new = np.float32(start) + np.float32(slope) * indices.astype(np.float32)
    is_within = (first <= indices) & (indices <= last)
    pixels[:] = np.where(is_within & (new > pixels), new, pixels)


@llvm_overload(raise_pixels, types.void, types.int64, types.float32, types.float32, types.int64, types.int64)
def _(builder: Builder, address: Value, start: Value, slope: Value, first: Value, last: Value) -> Value:
    indices, ramp = constant(_INDICES, *range(PIXELS)), constant(_PIXELS, *map(float, range(PIXELS)))
    low, high = (splat(builder, value, _INDICES) for value in (first, last))
    slopes, starts = splat(builder, slope, _PIXELS), splat(builder, start, _PIXELS)
    old = load_at(builder, address, _INDICES)
    new = builder.fadd(starts, builder.fmul(slopes, ramp))
    # Words of ones and zeros: LLVM packs truth values of 16 lanes into bytes where registers hold eight.
    after = builder.sext(builder.icmp_signed(">", low, indices), _INDICES)
    before = builder.sext(builder.icmp_signed(">", indices, high), _INDICES)
    is_within = builder.not_(builder.or_(after, before))
    # Numbers that are not negative compare as their words do. A store of a selection between new and old pixels would
    # become a masked one, which processors without AVX-512 may carry out lane by lane.
    words = builder.and_(builder.bitcast(new, _INDICES), is_within)
    store_at(builder, lanewise(builder, "smax", words, old), address)


def bound_columns(edges: int, row: float, columns: float, begins: int, ends: int) -> None:
    """Write the first and last column (8,) int32 within a face on 8 scan lines from ``row`` on.

    ``edges`` (2, 4, 2) float64 bound the columns from below and from above: column at row 0, and its change a row.
    """
    lows, highs = vector_at(edges, 16, np.float64).reshape((2, 4, 2, 1))
    rows = row + np.arange(LINES)
    low = np.clip((lows[:, 0] + lows[:, 1] * rows).max(axis=0), -0.5, columns)
    high = np.clip((highs[:, 0] + highs[:, 1] * rows).min(axis=0), -1.0, columns - 0.5)
    vector_at(begins, LINES, np.int32)[:] = np.ceil(low - OVERLAP)
    vector_at(ends, LINES, np.int32)[:] = np.floor(high + OVERLAP)


@llvm_overload(bound_columns, types.void, types.int64, *(types.float64,) * 2, *(types.int64,) * 2)
def _(builder: Builder, edges: Value, row: Value, columns: Value, begins: Value, ends: Value) -> Value:
    rows = builder.fadd(splat(builder, row, _LINES), constant(_LINES, *map(float, range(LINES))))
    width, half, overlap = splat(builder, columns, _LINES), constant(_LINES, 0.5), constant(_LINES, OVERLAP)

    def edge(number: int) -> Value:
        start, slope = (
            splat(builder, load_at(builder, edges, ir.DoubleType(), FLOAT * place), _LINES)
            for place in (2 * number, 2 * number + 1)
        )
        return builder.fadd(start, builder.fmul(slope, rows))

    def nearer(first: Value, second: Value, order: str) -> Value:
        return builder.select(builder.fcmp_ordered(order, first, second), first, second)

    low, high = constant(_LINES, -0.5), builder.fsub(width, half)
    for number in range(4):
        low, high = nearer(edge(number), low, ">"), nearer(edge(4 + number), high, "<")
    low = builder.fsub(nearer(low, width, "<"), overlap)
    high = builder.fadd(nearer(high, constant(_LINES, -1.0), ">"), overlap)
    for name, bound, result in (("ceil", low, begins), ("floor", high, ends)):
        whole = call(builder, f"llvm.{name}.v{LINES}f64", _LINES, bound)
        store_at(builder, builder.fptosi(whole, vector(INT, LINES)), result)
