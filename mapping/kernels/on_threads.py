"""Parallel loops whose body is compiled once, for one thread and for many.

Numba compiles the body of a parallel loop together with all kernels that it calls, three times over: as a body, in
its wrapper and in its caller. Here the loop only calls the serial kernel, by the address of its machine code, and
compiles in a fifth of the time.
"""

from collections.abc import Callable
from typing import Any

import numba
from numba import _dispatcher, types
from numba.core import cgutils

from lidarium.mapping.kernels.compilation import IS_INTERPRETED
from lidarium.mapping.kernels.llvm import Builder, Value, generic_llvm_overload

_utils: Any = cgutils
_kinds_of: Any = _dispatcher.compute_fingerprint  # type: ignore[attr-defined]
_types: Any = types


def on_threads(serial: Any, loop: Any) -> Callable[..., None]:  # noqa: ANN401
    """Return a function that runs a serial kernel on threads.

    ``loop`` is a parallel kernel that takes the address of the serial one, then the same arguments, and calls it by
    `call_at`. Both return nothing.
    """
    addresses: dict[bytes, int] = {}

    def run(*arguments: Any) -> None:  # noqa: ANN401
        if IS_INTERPRETED:
            loop(serial, *arguments)
            return
        kinds = _kinds_of(arguments)
        if kinds not in addresses:
            addresses[kinds] = _address_of(serial, arguments)
        loop(addresses[kinds], *arguments)

    return run


def _address_of(kernel: Any, arguments: tuple[Any, ...]) -> int:  # noqa: ANN401
    """Return the address of a kernel's machine code for types of arguments."""
    kinds = tuple(numba.typeof(each) for each in arguments)
    kernel.compile(kinds)
    compiled = kernel.overloads[kinds]
    return int(compiled.library.get_pointer_to_function(compiled.fndesc.llvm_func_name))


def call_at(address: Any, arguments: tuple[Any, ...]) -> None:  # noqa: ANN401
    """Call the kernel at an address (kernel).

    The arguments must have the types for which it is compiled.
    """
    address(*arguments)  # as Python runs kernels, they have no addresses


@generic_llvm_overload(call_at, lambda address, arguments: _types.void(address, arguments))
def _(context: Any, builder: Builder, signature: Any, values: list[Value]) -> Value:  # noqa: ANN401
    # Numba's own convention: places for the result and for an exception, then the arguments taken apart.
    kinds = signature.args[1].types
    called = context.call_conv.get_function_type(_types.none, kinds)
    places = [_utils.alloca_once(builder, place.pointee) for place in called.args[:2]]
    for place in places:
        builder.store(_utils.get_null_value(place.type.pointee), place)
    parts = context.get_arg_packer(kinds).as_arguments(builder, _utils.unpack_tuple(builder, values[1]))
    builder.call(builder.inttoptr(values[0], called.as_pointer()), [*places, *parts])
    return context.get_dummy_value()
