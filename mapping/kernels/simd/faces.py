"""Drawing a face: ranges of eight beams, or inverse depths of sixteen pixels, at once."""

import numpy as np
from llvmlite import ir
from numba import types

from lidarium.mapping.kernels.llvm import (
    INT,
    Builder,
    Value,
    constant,
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

FLOAT = 8
"""Bytes of a float64."""

_BEAMS = vector(ir.DoubleType(), BEAMS)
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
    """Raise the 16 float32 pixels from index ``first`` to ``last`` to at least ``start + slope * index``."""
    pixels, indices = vector_at(address, PIXELS, np.float32), np.arange(PIXELS)
    new = np.float32(start) + np.float32(slope) * indices.astype(np.float32)
    is_within = (first <= indices) & (indices <= last)
    pixels[:] = np.where(is_within & (new > pixels), new, pixels)


@llvm_overload(raise_pixels, types.void, types.int64, types.float32, types.float32, types.int64, types.int64)
def _(builder: Builder, address: Value, start: Value, slope: Value, first: Value, last: Value) -> Value:
    indices, ramp = constant(_INDICES, *range(PIXELS)), constant(_PIXELS, *map(float, range(PIXELS)))
    low, high = (splat(builder, value, _INDICES) for value in (first, last))
    slopes, starts = splat(builder, slope, _PIXELS), splat(builder, start, _PIXELS)
    old = load_at(builder, address, _PIXELS)
    new = builder.fadd(starts, builder.fmul(slopes, ramp))
    is_within = builder.and_(builder.icmp_signed("<=", low, indices), builder.icmp_signed("<=", indices, high))
    is_raised = builder.and_(is_within, builder.fcmp_ordered(">", new, old))
    store_at(builder, builder.select(is_raised, new, old), address)
