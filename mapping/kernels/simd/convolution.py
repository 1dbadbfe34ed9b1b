"""Weighted sums of shifted rows of numbers, in registers: what convolutions are made of.

Each sum is made in one order, with one rounding of each product and sum (``fma``): it is the same on every processor.
"""

import numpy as np
from llvmlite import ir
from numba import types

from lidarium.mapping.kernels.llvm import (
    LONG,
    Builder,
    Value,
    call,
    for_range,
    has_feature,
    llvm_overload,
    load_at,
    splat,
    stack_slot,
    store_at,
    vector,
)
from lidarium.mapping.kernels.views import grid_at, vector_at

OUTPUTS, LANES = (8, 32) if has_feature("avx512f") else (4, 16)
"""Sums that are made at once: rows, and numbers of each. As many as the processor has registers for."""

_REALS, _SIZE = vector(ir.FloatType(), LANES), 4


def add_taps(
    sums: int,
    row: int,
    source: int,
    channel: int,
    channels: int,
    taps: int,
    count: int,
    weights: int,
    bias: int,
    least: float,
    last: int,
) -> None:
    """Add shifted and weighted numbers of a source to OUTPUTS rows of LANES sums.

    Parameters
    ----------
    sums : int
        Address of the first row of sums, float32.
    row : int
        Bytes from one row of sums to the next.
    source : int
        Address of the source's first number, float32.
    channel : int
        Bytes from one channel of the source to the next.
    channels : int
        Number of channels.
    taps : int
        Address of the shifts [bytes], (count,) int64, in each of which a channel is added.
    count : int
        Number of shifts.
    weights : int
        Address of the weights, (channels, count, OUTPUTS) float32.
    bias : int
        Address of the bias of each row, (OUTPUTS,) float32; it is added first.
    least : float
        Sums below are raised to it then.
    last : int
        Address of channels, as far apart as those of the source, that are added to the rows in the end; 0: none.
    """
    factors = np.array(grid_at(weights, channels * count, OUTPUTS, np.float32), np.float64)
    rows = [vector_at(sums + output * row, LANES, np.float32) for output in range(OUTPUTS)]
    found = np.array(rows) + np.array(vector_at(bias, OUTPUTS, np.float32))[:, None]
    shifts = np.array(vector_at(taps, count, np.int64)) // _SIZE
    for k in range(channels):
        numbers = np.array(vector_at(source + k * channel, int(shifts.max()) + LANES, np.float32), np.float64)
        for factor, shift in zip(factors[k * count : (k + 1) * count], shifts.tolist(), strict=True):
            found = (factor[:, None] * numbers[shift : shift + LANES] + found).astype(np.float32)
    found = np.maximum(found, least)
    for output, total in enumerate(rows):
        total[:] = found[output]
        if last:
            total += vector_at(last + output * channel, LANES, np.float32)


@llvm_overload(add_taps, types.void, *(types.int64,) * 9, types.float64, types.int64)
def _(
    builder: Builder,
    sums: Value,
    row: Value,
    source: Value,
    channel: Value,
    channels: Value,
    taps: Value,
    count: Value,
    weights: Value,
    bias: Value,
    least: Value,
    last: Value,
) -> Value:
    def at(address: Value, step: Value, output: int) -> Value:
        return builder.add(address, builder.mul(step, ir.Constant(LONG, output)))

    def factor(address: Value, output: int) -> Value:
        return splat(builder, load_at(builder, address, _REALS.element, output * _SIZE), _REALS)

    begins = [load_at(builder, at(sums, row, output), _REALS) for output in range(OUTPUTS)]
    found = [stack_slot(builder, builder.fadd(each, factor(bias, output))) for output, each in enumerate(begins)]
    plane, weight = stack_slot(builder, source), stack_slot(builder, weights)
    with for_range(builder, channels):
        begin = builder.load(plane)
        with for_range(builder, count) as tap:
            shift = load_at(builder, builder.add(taps, builder.mul(tap.index, ir.Constant(LONG, 8))), LONG)
            numbers, factors = load_at(builder, builder.add(begin, shift), _REALS), builder.load(weight)
            for output, slot in enumerate(found):
                terms = numbers, factor(factors, output), builder.load(slot)
                builder.store(call(builder, f"llvm.fma.v{LANES}f32", _REALS, *terms), slot)
            builder.store(builder.add(factors, ir.Constant(LONG, OUTPUTS * _SIZE)), weight)
        builder.store(builder.add(begin, channel), plane)
    bound = splat(builder, builder.fptrunc(least, _REALS.element), _REALS)
    for slot in found:
        total = builder.load(slot)
        builder.store(builder.select(builder.fcmp_ordered("<", total, bound), bound, total), slot)
    with builder.if_then(builder.icmp_signed("!=", last, ir.Constant(LONG, 0))):
        for output, slot in enumerate(found):
            builder.store(builder.fadd(builder.load(slot), load_at(builder, at(last, channel, output), _REALS)), slot)
    for output, slot in enumerate(found):
        store_at(builder, builder.load(slot), at(sums, row, output))
