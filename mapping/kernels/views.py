"""Views of arrays at addresses, inside kernels.

Batches hold floors and maps of different sizes. Kernels therefore take tables of addresses and view each
array where it lies: nothing is concatenated or copied, a floor is shared by all episodes on it, and a map
grows alone. The Python side that fills such a table keeps its arrays alive.
"""

from typing import Any

import numpy as np
from numba import types
from numba.extending import intrinsic
from numba.np import arrayobj

from lidarium.mapping.kernels.compilation import kernel

_numba_arrays: Any = arrayobj

LINE = 64
"""A line of the caches [bytes]."""


def _fill_view(context: Any, builder: Any, kind: Any, address: Any, shape: list[Any]) -> Any:  # noqa: ANN401
    """Return an array of a kind at an address that nobody counts."""
    view = context.make_array(kind)(context, builder)
    size = context.get_abi_sizeof(context.get_data_type(kind.dtype))
    strides = [context.get_constant(types.intp, size)]
    for length in reversed(shape[1:]):
        strides.insert(0, builder.mul(strides[0], length))
    pointer = builder.inttoptr(address, view.data.type)
    _numba_arrays.populate_array(
        view,
        data=pointer,
        shape=shape,
        strides=strides,
        itemsize=context.get_constant(types.intp, size),
        meminfo=None,
    )
    return view._getvalue()


def _vector_of(typing_context: Any, address: Any, count: Any, kind: Any) -> Any:  # noqa: ANN401
    """View a vector of a kind at an address inside a kernel."""
    array = types.Array(kind.dtype, 1, "C")

    def generate(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:  # noqa: ANN401
        return _fill_view(context, builder, array, arguments[0], [arguments[1]])

    return array(types.intp, types.intp, kind), generate


def _grid_of(typing_context: Any, address: Any, rows: Any, columns: Any, kind: Any) -> Any:  # noqa: ANN401
    """View a grid of a kind at an address inside a kernel."""
    array = types.Array(kind.dtype, 2, "C")

    def generate(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:  # noqa: ANN401
        return _fill_view(context, builder, array, arguments[0], list(arguments[1:3]))

    return array(types.intp, types.intp, types.intp, kind), generate


def _room_for(typing_context: Any, count: Any, kind: Any) -> Any:  # noqa: ANN401
    """Set aside room for so many numbers of a kind on the stack of the kernel that asks, until it returns; tell its address."""

    def generate(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:  # noqa: ANN401
        room = builder.alloca(context.get_data_type(kind.dtype), arguments[0])
        room.align = LINE
        return builder.ptrtoint(room, context.get_value_type(types.intp))

    return types.intp(types.intp, kind), generate


_vector_view: Any = intrinsic(_vector_of)
_grid_view: Any = intrinsic(_grid_of)
_room: Any = intrinsic(_room_for)


@kernel(spliced=True)
def scratch_vector(count: int, kind: Any) -> Any:  # noqa: ANN401
    """Return ``count`` numbers of a kind, undefined at first, that are gone when the kernel that asks for them returns.

    For some numbers a beam, not for grids: a stack holds a few megabytes. Not within a loop, which would set
    aside room each time.
    """
    return _vector_view(_room(count, kind), count, kind)


@kernel(spliced=True)
def scratch_grid(rows: int, columns: int, kind: Any) -> Any:  # noqa: ANN401
    """Return a (rows, columns) grid in the way of ``scratch_vector``."""
    return _grid_view(_room(rows * columns, kind), rows, columns, kind)


@kernel(spliced=True)
def vector_at(address: int, count: int, kind: Any) -> Any:  # noqa: ANN401
    """View ``count`` numbers of a kind (such as np.float64) at an address inside a kernel; the caller keeps the array alive."""
    return _vector_view(address, count, kind)


@kernel(spliced=True)
def grid_at(address: int, rows: int, columns: int, kind: Any) -> Any:  # noqa: ANN401
    """View a (rows, columns) grid of a kind (such as np.float64) at an address inside a kernel."""
    return _grid_view(address, rows, columns, kind)


@kernel(spliced=True)
def bytes_at(address: int, count: int) -> Any:  # noqa: ANN401
    """View ``count`` uint8 at an address inside a kernel."""
    return _vector_view(address, count, np.uint8)


@kernel(spliced=True)
def int8_at(address: int, count: int) -> Any:  # noqa: ANN401
    """View ``count`` int8 at an address inside a kernel: a part of a row at less cost than a slice."""
    return _vector_view(address, count, np.int8)


@kernel(spliced=True)
def int8_grid_at(address: int, rows: int, columns: int) -> Any:  # noqa: ANN401
    """View a (rows, columns) int8 grid at an address inside a kernel."""
    return _grid_view(address, rows, columns, np.int8)


@kernel(spliced=True)
def uint8_grid_at(address: int, rows: int, columns: int) -> Any:  # noqa: ANN401
    """View a (rows, columns) uint8 grid at an address inside a kernel."""
    return _grid_view(address, rows, columns, np.uint8)


@kernel(spliced=True)
def uint16_grid_at(address: int, rows: int, columns: int) -> Any:  # noqa: ANN401
    """View a (rows, columns) uint16 grid at an address inside a kernel."""
    return _grid_view(address, rows, columns, np.uint16)


@kernel(spliced=True)
def word_grid_at(address: int, rows: int, columns: int) -> Any:  # noqa: ANN401
    """View a (rows, columns) uint64 grid at an address inside a kernel."""
    return _grid_view(address, rows, columns, np.uint64)


@kernel(spliced=True)
def int32_table_at(address: int, rows: int, columns: int) -> Any:  # noqa: ANN401
    """View a (rows, columns) int32 table at an address inside a kernel."""
    return _grid_view(address, rows, columns, np.int32)
