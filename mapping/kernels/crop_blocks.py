"""Blocks of 8 x 8 cells that are looked up within registers.

AVX-512 VBMI picks 64 bytes by their places in two instructions.
"""

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from lidarium.mapping.kernels.processor import has_feature
from lidarium.mapping.kernels.vectors import LEVELS

SIDE = 8
"""Side of a block [cells]."""

ROWS, COLUMNS = 12, 16
"""Rows and columns of the map that a block loads.

It shows cells of the first 11 each.
"""

CELLS = SIDE * SIDE
_BYTE, _INT, _LONG = ir.IntType(8), ir.IntType(32), ir.IntType(64)
_PIECE, _REGISTER, _INTS = (
    ir.VectorType(_BYTE, COLUMNS),
    ir.VectorType(_BYTE, CELLS),
    ir.VectorType(_INT, CELLS),
)
_ROWS_OF_BLOCK = ir.VectorType(_LONG, SIDE)
PLACES = 16
"""Binary places of the numbers by which cells are looked up."""


def _constant(kind: Any, value: int) -> Any:  # noqa: ANN401
    return ir.Constant(kind, [value] * kind.count)


def _lanes(*places: int) -> Any:  # noqa: ANN401
    return ir.Constant(ir.VectorType(_INT, len(places)), list(places))


def _address(builder: Any, address: Any, kind: Any) -> Any:  # noqa: ANN401
    return builder.inttoptr(address, kind.as_pointer())


def _call(builder: Any, name: str, *vectors: Any) -> Any:  # noqa: ANN401
    """Call one of the processor's functions of registers of bytes."""
    insert: Any = cgutils.get_or_insert_function
    kind = ir.FunctionType(_REGISTER, [_REGISTER] * len(vectors))
    return builder.call(insert(builder.module, kind, f"llvm.x86.avx512.{name}.qi.512"), list(vectors))


def _spread(builder: Any, value: Any) -> Any:  # noqa: ANN401
    """Repeat a number in the lanes of a block."""
    nothing = ir.Constant(_INTS, ir.Undefined)
    lane = builder.trunc(value, _INT)
    return builder.shuffle_vector(
        builder.insert_element(nothing, lane, ir.Constant(_INT, 0)), nothing, _lanes(*[0] * CELLS)
    )


def _write_places(typing_context: Any, x: Any, y: Any, first: Any, offsets: Any, places: Any) -> Any:  # noqa: ANN401
    """Write where the cells of a block lie in the rows and columns that it loads."""

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:  # noqa: ANN401
        x, y, first, offsets_at, places_at = arguments
        offsets = _address(builder, offsets_at, _INTS)
        columns, rows = (
            builder.add(
                builder.load(builder.gep(offsets, [ir.Constant(_INT, axis)]), align=1),
                _spread(builder, value),
            )
            for axis, value in enumerate((x, y))
        )
        column = builder.lshr(columns, _constant(_INTS, PLACES))
        sixteen_rows = builder.and_(
            builder.lshr(rows, _constant(_INTS, PLACES - 4)), _constant(_INTS, -COLUMNS)
        )
        place = builder.sub(builder.add(sixteen_rows, column), _spread(builder, first))
        builder.store(builder.trunc(place, _REGISTER), _address(builder, places_at, _REGISTER), align=1)

    return types.void(*(types.int64,) * 5), generate


def _load_row(builder: Any, address: Any) -> Any:  # noqa: ANN401
    return builder.load(_address(builder, address, _PIECE), align=1)


def _load_some(builder: Any, address: Any, columns: Any) -> Any:  # noqa: ANN401
    """Load the columns of a row whose bits are set, and zeros for the others.

    Nothing else is read.
    """
    insert: Any = cgutils.get_or_insert_function
    pointer, mask = (
        _address(builder, address, _PIECE),
        builder.bitcast(columns, ir.VectorType(ir.IntType(1), COLUMNS)),
    )
    kind = ir.FunctionType(_PIECE, [pointer.type, _INT, mask.type, _PIECE])
    function = insert(builder.module, kind, f"llvm.masked.load.v{COLUMNS}i8.p0")
    return builder.call(function, [pointer, ir.Constant(_INT, 1), mask, _constant(_PIECE, 0)])


def _store_levels(builder: Any, rows: list[Any], places_at: Any, crop_at: Any, side: Any) -> None:  # noqa: ANN401
    """Write a block of a crop from loaded rows, by its cells' places in them."""
    registers = rows
    while len(registers) > ROWS * COLUMNS // CELLS:
        joined = _lanes(*range(2 * registers[0].type.count))
        registers = [
            builder.shuffle_vector(*registers[k : k + 2], joined) for k in range(0, len(registers), 2)
        ]
    first, second, third = registers
    place = builder.load(_address(builder, places_at, _REGISTER), align=1)
    near, far = _call(builder, "vpermi2var", first, place, second), _call(builder, "permvar", third, place)
    # The highest bit of a place says whether it lies in the third register; the picks ignore it.
    zero, occupied, unknown, free = (_constant(_REGISTER, value) for value in (0, *LEVELS))
    log_odds = builder.select(builder.icmp_signed("<", place, zero), far, near)
    known = builder.select(builder.icmp_signed(">", log_odds, zero), occupied, unknown)
    levels = builder.bitcast(
        builder.select(builder.icmp_signed("<", log_odds, zero), free, known), _ROWS_OF_BLOCK
    )
    for row in range(SIDE):
        builder.store(
            builder.extract_element(levels, ir.Constant(_INT, row)),
            _address(builder, crop_at, _LONG),
            align=1,
        )
        crop_at = builder.add(crop_at, side)


def _write_block(typing_context: Any, log_odds: Any, stride: Any, places: Any, crop: Any, side: Any) -> Any:  # noqa: ANN401
    """Write a block that loads cells of the map only."""

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:  # noqa: ANN401
        row_at, stride, *where = arguments
        rows = []
        for _ in range(ROWS):
            rows.append(_load_row(builder, row_at))
            row_at = builder.add(row_at, stride)
        _store_levels(builder, rows, *where)

    return types.void(*(types.int64,) * 5), generate


def _write_border(
    typing_context: Any,  # noqa: ANN401
    log_odds: Any,  # noqa: ANN401
    stride: Any,  # noqa: ANN401
    cells: Any,  # noqa: ANN401
    places: Any,  # noqa: ANN401
    crop: Any,  # noqa: ANN401
    side: Any,  # noqa: ANN401
) -> Any:  # noqa: ANN401
    """Write a block that loads only those cells whose bits are set.

    Bits are uint16 for each row; the other cells are unknown.
    """

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:  # noqa: ANN401
        row_at, stride, cells_at, *where = arguments
        rows = []
        for row in range(ROWS):
            pointer = builder.gep(_address(builder, cells_at, ir.IntType(COLUMNS)), [ir.Constant(_INT, row)])
            rows.append(_load_some(builder, row_at, builder.load(pointer, align=1)))
            row_at = builder.add(row_at, stride)
        _store_levels(builder, rows, *where)

    return types.void(*(types.int64,) * 6), generate


CAN_LOOK_UP_IN_REGISTERS = has_feature("avx512vbmi")
"""Whether the processor can do this."""

write_places: Any = intrinsic(_write_places)
write_block: Any = intrinsic(_write_block)
write_border: Any = intrinsic(_write_border)
