"""Kernels in plain Python, where numba compiles nothing: ``NUMBA_DISABLE_JIT=1``.

For debugging only, and thousands of times slower. Kernels count on numbers as numba has them: what is read
from an array of small integers does not overflow, and a division by zero gives inf or nan. Python's numbers
do otherwise, so each kernel sees its arrays as ``Numbers``.
"""

import ctypes
import functools
import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numba.core import config
from numba.extending import intrinsic
from numpy.typing import NDArray

_numba_config: Any = config

IS_INTERPRETED = bool(_numba_config.DISABLE_JIT)
"""Whether kernels are run by Python, as they are written."""


class Numbers(np.ndarray[Any, Any]):
    """An array of which single elements are read as kernels expect them."""

    def __getitem__(self, place: Any) -> Any:  # noqa: ANN401
        """Return a part, or an element as a number of full width."""
        found = super().__getitem__(place)
        return found if isinstance(found, np.ndarray) else widened(found)


class Room(int):
    """The address of memory that lives as long as its views."""

    memory: NDArray[np.uint8]


def widened(value: Any) -> Any:  # noqa: ANN401
    """Return an argument or an element as compiled kernels take it.

    Integers but uint64 as Python's, Python's floats as float64, float32 as they are; arrays as ``Numbers``,
    and tuples by their members.
    """
    if isinstance(value, np.ndarray):
        return value if isinstance(value, Numbers) else value.view(Numbers)
    if isinstance(value, tuple):
        members = [widened(each) for each in value]
        return type(value)(*members) if hasattr(value, "_fields") else tuple(members)
    if isinstance(value, float):
        return np.float64(value)
    if isinstance(value, (np.integer, np.bool_)) and not isinstance(value, np.uint64):
        return value.item()
    return value


def interpreted(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a kernel that Python runs."""

    @functools.wraps(function)
    def call(*given: Any, **named: Any) -> Any:  # noqa: ANN401
        with np.errstate(all="ignore"):
            return function(*map(widened, given), **{name: widened(each) for name, each in named.items()})

    return call


def machine_code(generator: Callable[..., Any], plain: Callable[..., Any]) -> Any:  # noqa: ANN401
    """Return an operation for kernels: what LLVM makes of it, or its plain form where Python runs them."""
    return plain if IS_INTERPRETED else intrinsic(generator)


def array_at(address: int, shape: tuple[int, ...], kind: Any) -> NDArray[Any]:  # noqa: ANN401
    """Return a view of the array at an address."""
    size = math.prod(shape) * np.dtype(kind).itemsize
    if size == 0:
        return np.zeros(shape, kind).view(Numbers)
    memory: Any = (ctypes.c_char * size).from_address(address)
    memory.room = address  # where it is a Room, its memory lives on
    return np.frombuffer(memory, kind).reshape(shape).view(Numbers)


def room_for(count: int, kind: Any) -> Room:  # noqa: ANN401
    """Return the address of memory for so many numbers, kept by its views."""
    memory = np.zeros(max(count, 1) * np.dtype(kind).itemsize, np.uint8)
    room = Room(memory.ctypes.data)
    room.memory = memory
    return room
