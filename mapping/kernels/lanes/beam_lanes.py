"""Lanes that a face changes at once: ranges of eight beams, inverse depths of sixteen pixels."""

from typing import Any

from llvmlite import ir
from numba import types

from lidarium.mapping.kernels.in_python import plain_forms
from lidarium.mapping.kernels.in_python.interpreted import machine_code

LANES = 8
"""Beams into which a face is drawn at once."""

FLOAT = 8
"""Bytes of a float64."""

PIXEL_LANES = 16
"""Pixels into which a face is drawn at once."""

_BEAMS = ir.VectorType(ir.DoubleType(), LANES)


def _lower_lanes(
    typing_context: Any,  # noqa: ANN401
    inverses: Any,  # noqa: ANN401
    directions: Any,  # noqa: ANN401
    ranges: Any,  # noqa: ANN401
    distance: Any,  # noqa: ANN401
    run: Any,  # noqa: ANN401
    low: Any,  # noqa: ANN401
    high: Any,  # noqa: ANN401
) -> Any:  # noqa: ANN401
    """Lower the ranges of the beams in the lanes that meet a face."""

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:  # noqa: ANN401
        places = ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES)
        nothing, zero = ir.Constant(_BEAMS, ir.Undefined), ir.Constant(_BEAMS, [0.0] * LANES)

        def spread(value: Any) -> Any:  # noqa: ANN401
            first = builder.insert_element(nothing, value, ir.Constant(ir.IntType(32), 0))
            return builder.shuffle_vector(first, nothing, places)

        inverse_at, direction_at, range_at = (
            builder.inttoptr(address, _BEAMS.as_pointer()) for address in arguments[:3]
        )
        distances, runs, lows, highs = (spread(value) for value in arguments[3:])
        nearest = builder.load(range_at, align=FLOAT)
        candidates = builder.fmul(distances, builder.load(inverse_at, align=FLOAT))
        along = builder.fadd(runs, builder.fmul(candidates, builder.load(direction_at, align=FLOAT)))
        is_met = builder.and_(
            builder.and_(builder.fcmp_ordered("<=", lows, along), builder.fcmp_ordered("<=", along, highs)),
            builder.and_(
                builder.fcmp_ordered(">", candidates, zero), builder.fcmp_ordered("<", candidates, nearest)
            ),
        )
        builder.store(builder.select(is_met, candidates, nearest), range_at, align=FLOAT)

    return types.void(*(types.int64,) * 3, *(types.float64,) * 4), generate


lower_lanes = machine_code(_lower_lanes, plain_forms.lower_lanes)


_PIXELS, _PIXEL_PLACES = (
    ir.VectorType(ir.FloatType(), PIXEL_LANES),
    ir.VectorType(ir.IntType(32), PIXEL_LANES),
)


def _raise_lanes(
    typing_context: Any,  # noqa: ANN401
    address: Any,  # noqa: ANN401
    start: Any,  # noqa: ANN401
    slope: Any,  # noqa: ANN401
    first: Any,  # noqa: ANN401
    last: Any,  # noqa: ANN401
) -> Any:  # noqa: ANN401
    """Raise the pixels from lane ``first`` to lane ``last`` to ``start + slope * lane``."""

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:  # noqa: ANN401
        number = ir.IntType(32)
        zeros = ir.Constant(_PIXEL_PLACES, [0] * PIXEL_LANES)

        def spread(value: Any, kind: Any) -> Any:  # noqa: ANN401
            nothing = ir.Constant(kind, ir.Undefined)
            lone = builder.insert_element(nothing, value, ir.Constant(number, 0))
            return builder.shuffle_vector(lone, nothing, zeros)

        lanes = ir.Constant(_PIXEL_PLACES, list(range(PIXEL_LANES)))
        ramp = ir.Constant(_PIXELS, [float(lane) for lane in range(PIXEL_LANES)])
        low, high = (spread(builder.trunc(value, number), _PIXEL_PLACES) for value in arguments[3:])
        slopes, starts = spread(arguments[2], _PIXELS), spread(arguments[1], _PIXELS)
        pointer = builder.inttoptr(arguments[0], _PIXELS.as_pointer())
        old = builder.load(pointer, align=4)
        new = builder.fadd(starts, builder.fmul(slopes, ramp))
        is_within = builder.and_(
            builder.icmp_signed("<=", low, lanes), builder.icmp_signed("<=", lanes, high)
        )
        is_raised = builder.and_(is_within, builder.fcmp_ordered(">", new, old))
        builder.store(builder.select(is_raised, new, old), pointer, align=4)

    return types.void(types.int64, types.float32, types.float32, types.int64, types.int64), generate


raise_lanes = machine_code(_raise_lanes, plain_forms.raise_lanes)
