"""Views of arrays at addresses, inside kernels.

Batches hold floors and maps of different sizes. Kernels therefore take tables of addresses and view each
array in place: nothing is concatenated or copied, a floor is shared by all episodes on it, and a map grows
alone. The Python side that fills such a table keeps its arrays alive.

Each view is defined in Python first; below it is the text that kernels are compiled with.
"""

import ctypes
import math
from collections.abc import Iterable
from typing import Any, get_args, get_type_hints

import numba
import numpy as np
from numba import types
from numba.np import arrayobj
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, Numbers
from lidarium.mapping.kernels.llvm import Builder, Value, generic_llvm_overload, numba_types

_numba_arrays: Any = arrayobj

LINE = 64
"""A line of the caches [bytes]."""

ENTRY = 3
"""Numbers of an entry of a table of arrays: address, rows, columns (1 for a vector)."""


def array_at(address: int, shape: tuple[int, ...], dtype: Any) -> NDArray[Any]:  # noqa: ANN401
    """Return a view of the array at an address, for definitions that Python runs."""
    size = math.prod(shape) * np.dtype(dtype).itemsize
    if size == 0:
        return np.zeros(shape, dtype).view(Numbers)
    memory: Any = (ctypes.c_char * size).from_address(int(address))
    return np.frombuffer(memory, dtype).reshape(shape).view(Numbers)


def vector_at(address: int, count: int, dtype: Any) -> Any:  # noqa: ANN401
    """View ``count`` numbers of a type such as ``np.float64`` at an address.

    It gives a part of a row at less cost than a slice. The caller keeps the array alive.
    """
    return array_at(address, (count,), dtype)


def grid_at(address: int, rows: int, columns: int, dtype: Any) -> Any:  # noqa: ANN401
    """View a (rows, columns) grid at an address."""
    return array_at(address, (rows, columns), dtype)


def scratch_vector(count: int, dtype: Any) -> Any:  # noqa: ANN401
    """Return a vector on the stack of the calling kernel: undefined at first, and gone when it returns.

    For some numbers per beam, not for grids: a stack holds a few megabytes. Do not call it in a loop, which would
    reserve memory each time.
    """
    return np.zeros(count, dtype).view(Numbers)


def scratch_grid(rows: int, columns: int, dtype: Any) -> Any:  # noqa: ANN401
    """Return a (rows, columns) grid as ``scratch_vector`` does."""
    return np.zeros((rows, columns), dtype).view(Numbers)


def arrays_at(table: Array, named: Any) -> Any:  # noqa: ANN401
    """View all arrays of a table (arrays, ENTRY) int64 of ``table_of`` as the fields of a named tuple.

    The fields of its class are annotated ``Annotated[Array, dtype, dimensions]``.
    """
    views = []
    for (dtype, dimensions), (address, *shape) in zip(_declared(named), table.tolist(), strict=False):
        views.append(array_at(address, tuple(shape[:dimensions]), dtype))
    return named(*views)


def table_of(arrays: Iterable[NDArray[Any]]) -> NDArray[np.int64]:
    """Return the table of arrays, shape (arrays, ENTRY); the caller keeps them alive."""
    return np.array(
        [(array.ctypes.data, array.shape[0], array.size // max(array.shape[0], 1)) for array in arrays],
        np.int64,
    )


def _declared(named: Any) -> list[tuple[Any, int]]:  # noqa: ANN401
    """Return dtype and dimensions of the fields of a class of arrays, in order."""
    hints = get_type_hints(named, include_extras=True)
    return [get_args(hints[name])[1:3] for name in named._fields]


def _fill_view(context: Any, builder: Builder, view_type: Any, address: Value, shape: list[Value]) -> Value:  # noqa: ANN401
    """Return an array at an address, without a count of references."""
    view = context.make_array(view_type)(context, builder)
    size = context.get_abi_sizeof(context.get_data_type(view_type.dtype))
    strides = [context.get_constant(types.intp, size)]
    for length in reversed(shape[1:]):
        strides.insert(0, builder.mul(strides[0], length))
    _numba_arrays.populate_array(
        view,
        data=builder.inttoptr(address, view.data.type),
        shape=shape,
        strides=strides,
        itemsize=context.get_constant(types.intp, size),
        meminfo=None,
    )
    return view._getvalue()


def _reserve(context: Any, builder: Builder, dtype: Any, count: Value) -> Value:  # noqa: ANN401
    """Return the address of memory for a number of elements on the kernel's stack."""
    memory = builder.alloca(context.get_data_type(dtype), count)
    memory.align = LINE
    return builder.ptrtoint(memory, context.get_value_type(types.intp))


_INTEGERS = (types.intp,) * 3


def _array(dtype: Any, dimensions: int) -> Any:  # noqa: ANN401
    """Return the type of views of numbers of a class such as ``np.float64``."""
    return types.Array(dtype.dtype, dimensions, "C")


@generic_llvm_overload(vector_at, lambda address, count, dtype: _array(dtype, 1)(*_INTEGERS[:2], dtype))
def _(context: Any, builder: Builder, signature: Any, values: list[Value]) -> Value:  # noqa: ANN401
    return _fill_view(context, builder, signature.return_type, values[0], [values[1]])


@generic_llvm_overload(grid_at, lambda address, rows, columns, dtype: _array(dtype, 2)(*_INTEGERS, dtype))
def _(context: Any, builder: Builder, signature: Any, values: list[Value]) -> Value:  # noqa: ANN401
    return _fill_view(context, builder, signature.return_type, values[0], values[1:3])


@generic_llvm_overload(scratch_vector, lambda count, dtype: _array(dtype, 1)(types.intp, dtype))
def _(context: Any, builder: Builder, signature: Any, values: list[Value]) -> Value:  # noqa: ANN401
    address = _reserve(context, builder, signature.return_type.dtype, values[0])
    return _fill_view(context, builder, signature.return_type, address, values[:1])


@generic_llvm_overload(scratch_grid, lambda rows, columns, dtype: _array(dtype, 2)(*_INTEGERS[:2], dtype))
def _(context: Any, builder: Builder, signature: Any, values: list[Value]) -> Value:  # noqa: ANN401
    address = _reserve(context, builder, signature.return_type.dtype, builder.mul(values[0], values[1]))
    return _fill_view(context, builder, signature.return_type, address, values[:2])


def _named_type(table: Any, named: Any) -> Any:  # noqa: ANN401
    """Return the signature of ``arrays_at``."""
    declared = _declared(named.instance_class)
    members = [types.Array(numba.from_dtype(np.dtype(dtype)), count, "C") for dtype, count in declared]
    return numba_types.NamedTuple(members, named.instance_class)(table, named)


@generic_llvm_overload(arrays_at, _named_type)
def _(context: Any, builder: Builder, signature: Any, values: list[Value]) -> Value:  # noqa: ANN401
    entries, views = context.make_array(signature.args[0])(context, builder, values[0]).data, []
    for index, member in enumerate(signature.return_type.types):
        address, *shape = (
            builder.load(builder.gep(entries, [context.get_constant(types.intp, ENTRY * index + number)]))
            for number in range(1 + member.ndim)
        )
        views.append(_fill_view(context, builder, member, address, shape))
    return context.make_tuple(builder, signature.return_type, views)
