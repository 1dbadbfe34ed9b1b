"""The nearest code of the 64 points of a tile, all in registers."""

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

LANES = 16
"""Points of a vector register."""

TILE = 64
"""Points of a tile."""

_PLACES = ir.VectorType(ir.IntType(32), LANES)
_NUMBERS = ir.VectorType(ir.FloatType(), LANES)
_FLOAT, _BYTES = 4, LANES * 4


def _nearest_in_tile(
    typing_context: Any,  # noqa: ANN401
    points: Any,  # noqa: ANN401
    codes: Any,  # noqa: ANN401
    numbers: Any,  # noqa: ANN401
    count: Any,  # noqa: ANN401
    squares: Any,  # noqa: ANN401
    labels: Any,  # noqa: ANN401
) -> Any:  # noqa: ANN401
    """Lower the squared distances of a tile's points by codes, and note which code is nearest.

    All but ``count`` are addresses: of the (3, 64) float32 coordinates, (count, 3) float32 codes, (count,)
    int32 numbers of the codes, (64,) float32 squared distances so far, and (64,) int32 labels so far. Of
    equal codes the first stays.
    """

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:  # noqa: ANN401
        points, codes, numbers, count, squares, labels = arguments
        vectors = range(TILE // LANES)

        def vector_at(address: Any, place: int, kind: Any) -> Any:  # noqa: ANN401
            moved = builder.add(address, ir.Constant(address.type, place * _BYTES))
            return builder.inttoptr(moved, kind.as_pointer())

        def spread_at(address: Any, kind: Any) -> Any:  # noqa: ANN401
            value = builder.load(builder.inttoptr(address, kind.element.as_pointer()))
            nothing = ir.Constant(kind, ir.Undefined)
            lone = builder.insert_element(nothing, value, ir.Constant(ir.IntType(32), 0))
            return builder.shuffle_vector(lone, nothing, ir.Constant(_PLACES, [0] * LANES))

        def load(address: Any, place: int, kind: Any) -> Any:  # noqa: ANN401
            return builder.load(vector_at(address, place, kind), align=_FLOAT)

        insert: Any = cgutils.alloca_once_value
        sides = [
            [load(points, axis * len(vectors) + place, _NUMBERS) for axis in range(3)] for place in vectors
        ]
        nearest = [insert(builder, load(squares, place, _NUMBERS)) for place in vectors]
        chosen = [insert(builder, load(labels, place, _PLACES)) for place in vectors]
        loop: Any = cgutils.for_range
        with loop(builder, count) as step:
            first = builder.add(codes, builder.mul(step.index, ir.Constant(codes.type, 3 * _FLOAT)))
            code = [
                spread_at(builder.add(first, ir.Constant(codes.type, _FLOAT * axis)), _NUMBERS)
                for axis in range(3)
            ]
            number = spread_at(
                builder.add(numbers, builder.mul(step.index, ir.Constant(numbers.type, _FLOAT))), _PLACES
            )
            for place in vectors:
                across = [builder.fsub(side, own) for side, own in zip(sides[place], code, strict=True)]
                x, y, z = (builder.fmul(each, each) for each in across)
                square, old = builder.fadd(builder.fadd(x, y), z), builder.load(nearest[place])
                is_nearer = builder.fcmp_ordered("<", square, old)
                builder.store(builder.select(is_nearer, square, old), nearest[place])
                builder.store(builder.select(is_nearer, number, builder.load(chosen[place])), chosen[place])
        for place in vectors:
            builder.store(builder.load(nearest[place]), vector_at(squares, place, _NUMBERS), align=_FLOAT)
            builder.store(builder.load(chosen[place]), vector_at(labels, place, _PLACES), align=_FLOAT)

    return types.void(*(types.int64,) * 6), generate


nearest_in_tile: Any = intrinsic(_nearest_in_tile)
