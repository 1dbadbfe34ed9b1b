"""The nearest code of the 64 points of a tile, all in registers."""

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils

from lidarium.mapping.kernels.in_python import plain_forms
from lidarium.mapping.kernels.in_python.interpreted import machine_code

LANES = 16
"""Points of a vector register."""

TILE = 64
"""Points of a tile."""

_PLACES = ir.VectorType(ir.IntType(32), LANES)
_NUMBERS = ir.VectorType(ir.FloatType(), LANES)
_FLOAT, _BYTES = 4, LANES * 4

_insert: Any = cgutils.alloca_once_value
_loop: Any = cgutils.for_range


def _address(builder: Any, start: Any, offset: Any, kind: Any) -> Any:  # noqa: ANN401
    """Return a pointer to a kind so many bytes after an address."""
    return builder.inttoptr(builder.add(start, offset), kind.as_pointer())


def _vector(builder: Any, start: Any, place: int, kind: Any) -> Any:  # noqa: ANN401
    """Return a pointer to one of the vectors at an address."""
    return _address(builder, start, ir.Constant(start.type, place * _BYTES), kind)


def _load(builder: Any, start: Any, place: int, kind: Any) -> Any:  # noqa: ANN401
    """Load one of the vectors at an address."""
    return builder.load(_vector(builder, start, place, kind), align=_FLOAT)


def _spread(builder: Any, start: Any, place: Any, kind: Any) -> Any:  # noqa: ANN401
    """Repeat one of the numbers at an address in all lanes."""
    offset = builder.mul(place, ir.Constant(start.type, _FLOAT))
    nothing = ir.Constant(kind, ir.Undefined)
    value = builder.load(_address(builder, start, offset, kind.element))
    lone = builder.insert_element(nothing, value, ir.Constant(ir.IntType(32), 0))
    return builder.shuffle_vector(lone, nothing, ir.Constant(_PLACES, [0] * LANES))


def _nearest_in_tile(
    typing_context: Any,  # noqa: ANN401
    points: Any,  # noqa: ANN401
    codes: Any,  # noqa: ANN401
    numbers: Any,  # noqa: ANN401
    count: Any,  # noqa: ANN401
    squares: Any,  # noqa: ANN401
    labels: Any,  # noqa: ANN401
) -> Any:  # noqa: ANN401
    """Lower squared distances of a tile's points by codes, and note the nearest.

    All but ``count`` are addresses: of the (3, 64) float32 coordinates, (count, 3) float32 codes, (count,)
    int32 numbers of the codes, (64,) float32 squared distances so far, and (64,) int32 labels so far. Of
    equal codes the first stays.
    """

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:  # noqa: ANN401
        points, codes, numbers, count, squares, labels = arguments
        vectors = range(TILE // LANES)
        sides = [
            [_load(builder, points, axis * len(vectors) + place, _NUMBERS) for axis in range(3)]
            for place in vectors
        ]
        nearest = [_insert(builder, _load(builder, squares, place, _NUMBERS)) for place in vectors]
        chosen = [_insert(builder, _load(builder, labels, place, _PLACES)) for place in vectors]
        with _loop(builder, count) as step:
            first = builder.mul(step.index, ir.Constant(codes.type, 3))
            places = (builder.add(first, ir.Constant(codes.type, axis)) for axis in range(3))
            code = [_spread(builder, codes, place, _NUMBERS) for place in places]
            number = _spread(builder, numbers, step.index, _PLACES)
            for place in vectors:
                across = [builder.fsub(side, own) for side, own in zip(sides[place], code, strict=True)]
                x, y, z = (builder.fmul(each, each) for each in across)
                square, old = builder.fadd(builder.fadd(x, y), z), builder.load(nearest[place])
                is_nearer = builder.fcmp_ordered("<", square, old)
                builder.store(builder.select(is_nearer, square, old), nearest[place])
                builder.store(builder.select(is_nearer, number, builder.load(chosen[place])), chosen[place])
        for place in vectors:
            for held, start, kind in ((nearest, squares, _NUMBERS), (chosen, labels, _PLACES)):
                builder.store(builder.load(held[place]), _vector(builder, start, place, kind), align=_FLOAT)

    return types.void(*(types.int64,) * 6), generate


nearest_in_tile = machine_code(_nearest_in_tile, plain_forms.nearest_in_tile)
