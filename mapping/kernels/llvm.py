"""Functions of kernels that are written in LLVM's language, and the words that such text shares."""

import inspect
from collections.abc import Callable
from typing import Any

from llvmlite import binding, ir
from numba import types
from numba.core import cgutils, config
from numba.extending import lower_builtin, type_callable

from lidarium.mapping.kernels.compilation import IS_INTERPRETED

Builder = Any
"""An ``llvmlite.ir.IRBuilder``."""

Value = Any
"""A value or a type of LLVM."""

BLOCK = 64
"""Cells of a block: as many as a word has bits."""

INT, LONG = ir.IntType(32), ir.IntType(64)

_numba_config: Any = config
_utils: Any = cgutils
numba_types: Any = types
pack_array: Any = cgutils.pack_array
_lower: Any = lower_builtin
_type_callable: Any = type_callable


def has_feature(name: str) -> bool:
    """Whether kernels are compiled for a processor with a feature (LLVM's name)."""
    if _numba_config.DISABLE_JIT:
        return False
    if _numba_config.CPU_NAME is not None or _numba_config.CPU_FEATURES is not None:
        return f"+{name}" in (_numba_config.CPU_FEATURES or "").split(",")
    if name.startswith("avx") and not _numba_config.ENABLE_AVX:
        return False
    return bool(binding.get_host_cpu_features().get(name, False))


# -- Overloads ---------------------------------------------------------------------------------------------


def llvm_overload(function: Callable[..., Any], result: Any, *arguments: Any) -> Callable[[Any], Any]:  # noqa: ANN401
    """Compile calls of a Python function in kernels by the decorated LLVM text.

    As with numba's ``overload``, Python runs the function itself: with ``NUMBA_DISABLE_JIT=1``, and in tests, which
    compare the two.
    """
    signature = result(*arguments)

    def decorate(generate: Callable[..., Value]) -> Callable[..., Value]:
        def lower(context: Any, builder: Builder, _signature: Any, values: Any) -> Value:  # noqa: ANN401
            value = generate(builder, *values)
            return context.get_dummy_value() if result is types.void else value

        generic_llvm_overload(function, lambda *_arguments: signature)(lower)
        return generate

    return decorate


def generic_llvm_overload(function: Callable[..., Any], typer: Callable[..., Any]) -> Callable[[Any], Any]:
    """Do as ``llvm_overload`` for any types.

    ``typer`` returns the signature for types of arguments; the decorated function takes numba's context, the
    builder, that signature and the arguments' values.
    """

    def decorate(lower: Callable[..., Value]) -> Callable[..., Value]:
        if not IS_INTERPRETED:
            named: Any = lambda *arguments: typer(*arguments)  # noqa: E731
            named.pysig = inspect.signature(function)
            _type_callable(function)(lambda _context: named)
            _lower(function, numba_types.VarArg(numba_types.Any))(lower)
        return lower

    return decorate


# -- Words of the text -------------------------------------------------------------------------------------

stack_slot: Any = _utils.alloca_once_value
"""Return a place on the stack that holds a value at first."""

for_range: Any = _utils.for_range
"""Return the context of text that runs a number of times; its ``index`` counts from 0."""


def vector(element: Value, count: int) -> Value:
    """Return the type of vectors of a number of elements."""
    return ir.VectorType(element, count)


def constant(vector_type: Value, *numbers: Any) -> Value:  # noqa: ANN401
    """Return a vector of these numbers, or of one in all lanes."""
    return ir.Constant(vector_type, list(numbers) if len(numbers) > 1 else list(numbers) * vector_type.count)


def splat(builder: Builder, value: Value, vector_type: Value) -> Value:
    """Repeat a number in all lanes; wider integers are cut to the element's width."""
    undefined = ir.Constant(vector_type, ir.Undefined)
    element = value if value.type == vector_type.element else builder.trunc(value, vector_type.element)
    first = builder.insert_element(undefined, element, ir.Constant(INT, 0))
    return builder.shuffle_vector(first, undefined, constant(vector(INT, vector_type.count), 0))


def call(builder: Builder, name: str, result: Value, *values: Value) -> Value:
    """Call one of LLVM's own functions."""
    function_type = ir.FunctionType(result, [value.type for value in values])
    return builder.call(_utils.get_or_insert_function(builder.module, function_type, name), values)


def lanewise(builder: Builder, name: str, first: Value, second: Value) -> Value:
    """Call one of LLVM's functions of two vectors of integers, such as ``umin``."""
    kind = first.type
    return call(builder, f"llvm.{name}.v{kind.count}i{kind.element.width}", kind, first, second)


def pointer_at(builder: Builder, address: Value, value_type: Value, offset: int = 0) -> Value:
    """Return a pointer to a value, a number of bytes after an address."""
    moved = builder.add(address, ir.Constant(address.type, offset)) if offset else address
    return builder.inttoptr(moved, value_type.as_pointer())


def load_at(builder: Builder, address: Value, value_type: Value, offset: int = 0) -> Value:
    """Load a value from any address and offset [bytes]."""
    return builder.load(pointer_at(builder, address, value_type, offset), align=1)


def store_at(builder: Builder, value: Value, address: Value, offset: int = 0) -> None:
    """Store a value at any address and offset [bytes]."""
    builder.store(value, pointer_at(builder, address, value.type, offset), align=1)


def bits_of_lanes(builder: Builder, lanes: Value) -> Value:
    """Return a vector of truth values as an integer, bit 0 the first lane."""
    return builder.bitcast(lanes, ir.IntType(lanes.type.count))


def if_any(builder: Builder, lanes: Value) -> Any:  # noqa: ANN401
    """Return the context of text that runs if any lane is true."""
    return builder.if_then(any_of(builder, lanes))


def any_of(builder: Builder, lanes: Value) -> Value:
    """Return whether any lane is true."""
    bits = bits_of_lanes(builder, lanes)
    return builder.icmp_unsigned("!=", bits, ir.Constant(bits.type, 0))


def min_lanes(builder: Builder, value: Value, other: Value) -> Value:
    """Return the smaller of two signed integers in each lane."""
    return builder.select(builder.icmp_signed("<", value, other), value, other)


def max_lanes(builder: Builder, value: Value, other: Value) -> Value:
    """Return the larger of two signed integers in each lane."""
    return builder.select(builder.icmp_signed(">", value, other), value, other)


HAS_GATHERS = has_feature("avx512f")
"""Whether the processor looks up sixteen numbers at once in registers that are wide enough."""


def gather(builder: Builder, address: Value, offsets: Value, alive: Value) -> Value:
    """Return the int32 at each of 16 offsets [bytes] from an address; 0 in lanes that are not alive."""
    zeros = constant(offsets.type, 0)
    if HAS_GATHERS:
        table, one = builder.inttoptr(address, ir.IntType(8).as_pointer()), ir.Constant(INT, 1)
        name = "llvm.x86.avx512.mask.gather.dpi.512"
        return call(builder, name, offsets.type, zeros, table, offsets, alive, one)
    count = offsets.type.count
    longs = vector(LONG, count)
    addresses = builder.add(builder.zext(offsets, longs), splat(builder, address, longs))
    pointers = builder.inttoptr(addresses, vector(INT.as_pointer(), count))
    return call(builder, f"llvm.masked.gather.v{count}i32.v{count}p0", offsets.type, pointers, alive, zeros)
