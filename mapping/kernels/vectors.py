"""Vectors of 64 lanes in the code that LLVM compiles."""

from typing import Any

from llvmlite import ir
from numba.core import cgutils

BLOCK = 64
"""Cells of a block."""

LEVELS = (0, 127, 255)
"""What an occupied, an unknown and a free cell is in maps of levels (uint8)."""

INT16, INT64 = ir.IntType(16), ir.IntType(64)
BYTES, SHORTS = ir.VectorType(ir.IntType(8), BLOCK), ir.VectorType(INT16, BLOCK)
MASK = ir.VectorType(ir.IntType(1), BLOCK)
NO_BYTES, NO_SHORTS = ir.Constant(BYTES, [0] * BLOCK), ir.Constant(SHORTS, [0] * BLOCK)


def splat(builder: Any, value: Any, kind: Any) -> Any:  # noqa: ANN401
    """Repeat an integer in all lanes of a kind of vector."""
    nothing = ir.Constant(kind, ir.Undefined)
    lane = value if value.type == kind.element else builder.trunc(value, kind.element)
    first = builder.insert_element(nothing, lane, ir.Constant(ir.IntType(32), 0))
    return builder.shuffle_vector(
        first, nothing, ir.Constant(ir.VectorType(ir.IntType(32), BLOCK), [0] * BLOCK)
    )


def call_vectors(builder: Any, name: str, first: Any, second: Any) -> Any:  # noqa: ANN401
    """Call one of LLVM's own functions of two vectors."""
    kind = first.type
    insert: Any = cgutils.get_or_insert_function
    function = insert(
        builder.module, ir.FunctionType(kind, [kind, kind]), f"llvm.{name}.v{BLOCK}i{kind.element.width}"
    )
    return builder.call(function, [first, second])


alloca: Any = cgutils.alloca_once_value


def load_at(builder: Any, address: Any, kind: Any) -> Any:  # noqa: ANN401
    """Load a vector of a kind from any address."""
    return builder.load(builder.inttoptr(address, kind.as_pointer()), align=1)


def store_at(builder: Any, value: Any, address: Any) -> None:  # noqa: ANN401
    """Store a vector at any address."""
    builder.store(value, builder.inttoptr(address, value.type.as_pointer()), align=1)
