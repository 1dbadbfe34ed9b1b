"""Ranges of eight beams that a face lowers at once."""

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

LANES = 8
"""Beams into which a face is drawn at once."""

FLOAT = 8
"""Bytes of a float64."""

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


lower_lanes: Any = intrinsic(_lower_lanes)
