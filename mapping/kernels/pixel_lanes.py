"""Rows of sixteen pixels that a face raises at once."""

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

LANES = 16
"""Pixels into which a face is drawn at once."""

_PIXELS, _PLACES = ir.VectorType(ir.FloatType(), LANES), ir.VectorType(ir.IntType(32), LANES)


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
        zeros = ir.Constant(_PLACES, [0] * LANES)

        def spread(value: Any, kind: Any) -> Any:  # noqa: ANN401
            nothing = ir.Constant(kind, ir.Undefined)
            lone = builder.insert_element(nothing, value, ir.Constant(number, 0))
            return builder.shuffle_vector(lone, nothing, zeros)

        lanes = ir.Constant(_PLACES, list(range(LANES)))
        ramp = ir.Constant(_PIXELS, [float(lane) for lane in range(LANES)])
        low, high = (spread(builder.trunc(value, number), _PLACES) for value in arguments[3:])
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


raise_lanes: Any = intrinsic(_raise_lanes)
