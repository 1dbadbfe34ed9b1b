"""Views of arrays at addresses, inside kernels.

Batches hold floors and maps of different sizes. Kernels therefore take tables of addresses and view each
array where it lies: nothing is concatenated or copied, a floor is shared by all episodes on it, and a map
grows alone. The Python side that fills such a table keeps its arrays alive.
"""

from collections.abc import Iterable
from typing import Any, NamedTuple, get_args, get_type_hints

import numba
import numpy as np
from numba import types
from numba.np import arrayobj
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.in_python import plain_forms
from lidarium.mapping.kernels.in_python.interpreted import machine_code, room_for

_numba_arrays: Any = arrayobj
_numba_types: Any = types

LINE = 64
"""A line of the caches [bytes]."""

ENTRY = 3
"""Numbers of an entry of a table of arrays: address, rows, columns (1 for a vector)."""


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
    """Reserve room for so many numbers on the calling kernel's stack.

    Returns its address, valid until that kernel returns. The numbers are of a given kind.
    """

    def generate(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:  # noqa: ANN401
        room = builder.alloca(context.get_data_type(kind.dtype), arguments[0])
        room.align = LINE
        return builder.ptrtoint(room, context.get_value_type(types.intp))

    return types.intp(types.intp, kind), generate


def _forms_of(named: type) -> list[Any]:
    """Return the array types that a class of arrays declares, in the order of its fields."""
    hints = get_type_hints(named, include_extras=True)
    forms = []
    for name in named._fields:  # type: ignore[attr-defined]
        _, dtype, dimensions = get_args(hints[name])
        forms.append(types.Array(numba.from_dtype(np.dtype(dtype)), dimensions, "C"))
    return forms


def _arrays_of(typing_context: Any, table: Any, kind: Any) -> Any:  # noqa: ANN401
    """View all arrays of a table as the fields of a class of arrays inside a kernel."""
    forms = _forms_of(kind.instance_class)
    named: Any = _numba_types.NamedTuple(forms, kind.instance_class)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:  # noqa: ANN401
        entries = context.make_array(signature.args[0])(context, builder, arguments[0]).data
        views = []
        for place, form in enumerate(forms):
            address, *shape = (
                builder.load(builder.gep(entries, [context.get_constant(types.intp, ENTRY * place + number)]))
                for number in range(1 + form.ndim)
            )
            views.append(_fill_view(context, builder, form, address, shape))
        return context.make_tuple(builder, named, views)

    return named(table, kind), generate


_vector_view = machine_code(_vector_of, plain_forms.vector_view)
_grid_view = machine_code(_grid_of, plain_forms.grid_view)
_named_views = machine_code(_arrays_of, plain_forms.named_views)
_room = machine_code(_room_for, room_for)


@kernel(spliced=True)
def scratch_vector(count: int, kind: Any) -> Any:  # noqa: ANN401
    """Return ``count`` numbers of a kind, for use within the calling kernel.

    Undefined at first, and gone when the calling kernel returns.

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
    """View ``count`` numbers of a kind at an address inside a kernel.

    A kind is such as np.float64. The caller keeps the array alive.
    """
    return _vector_view(address, count, kind)


@kernel(spliced=True)
def grid_at(address: int, rows: int, columns: int, kind: Any) -> Any:  # noqa: ANN401
    """View a (rows, columns) grid of a kind at an address inside a kernel.

    A kind is such as np.float64.
    """
    return _grid_view(address, rows, columns, kind)


@kernel(spliced=True)
def bytes_at(address: int, count: int) -> Any:  # noqa: ANN401
    """View ``count`` uint8 at an address inside a kernel."""
    return _vector_view(address, count, np.uint8)


@kernel(spliced=True)
def int8_at(address: int, count: int) -> Any:  # noqa: ANN401
    """View ``count`` int8 at an address inside a kernel.

    It gives a part of a row at less cost than a slice.
    """
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


def table_of(arrays: Iterable[NDArray[Any]]) -> NDArray[np.int64]:
    """Return the table of arrays, shape (arrays, ENTRY); the caller keeps them alive."""
    return np.array(
        [(array.ctypes.data, array.shape[0], array.size // max(array.shape[0], 1)) for array in arrays],
        np.int64,
    )


@kernel(spliced=True)
def arrays_at(table: Array, kind: type[NamedTuple]) -> Any:  # noqa: ANN401
    """View all arrays of a table inside a kernel.

    Parameters
    ----------
    table : (arrays, ENTRY) int64
        What ``table_of`` returned, in the order of the fields of ``kind``.
    kind : NamedTuple class
        Its fields are annotated ``Annotated[Array, dtype, dimensions]``.
    """
    return _named_views(table, kind)
