"""The one decorator of all numba kernels: exact arithmetic, cached where a directory can be written.

Numba caches compiled code per source file and does not see a change in another file that the kernel calls into. The
cache directory is therefore keyed by a hash of all sources with kernels, and is the first writable one of: the
package's own folder, the user's cache folder, the temporary folder.

Batches hold floors and maps of different sizes. Kernels therefore take tables of addresses and view each array where it
lies (``*_at`` below): nothing is concatenated or copied, a floor is shared by all episodes on it, and a map grows alone.
The Python side that fills such a table keeps its arrays alive.
"""

import hashlib
import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
import numpy as np
from numba import types
from numba.core import config
from numba.extending import intrinsic
from numba.np import arrayobj
from numpy.typing import NDArray

from lidarium.mapping.files import first_writable, user_cache_folder

Array = NDArray[Any]
"""An array in the signature of a kernel; its docstring gives shape and type."""

_numba_config: Any = config
_numba_arrays: Any = arrayobj

LINE = 64
"""A line of the caches [bytes]."""

PACKAGE_FOLDERS = ("mapping", "envs", "evaluation")


def _source_folders() -> list[Path]:
    """Folders whose kernels call each other: this one and its neighbours."""
    here = Path(__file__).resolve().parent
    return [here.parent / name for name in PACKAGE_FOLDERS]


def _sources_hash() -> str:
    digest = hashlib.sha256(numba.__version__.encode())
    for folder in _source_folders():
        for path in sorted(folder.rglob("*.py")):
            source = path.read_bytes()
            if b"@kernel" in source:
                digest.update(path.relative_to(folder.parent).as_posix().encode())
                digest.update(source)
    return digest.hexdigest()[:16]


def _cache_folder() -> Path | None:
    """Return the first writable cache folder, or None where nothing can be written."""
    candidates = (
        Path(__file__).resolve().parent / "__pycache__" / "kernels",
        user_cache_folder() / "lidarium" / "kernels",
        Path(tempfile.gettempdir()) / "lidarium-kernels",
    )
    return first_writable(candidate / _sources_hash() for candidate in candidates)


_CHOSEN_BY_USER = bool(os.environ.get("NUMBA_CACHE_DIR"))
_FOLDER = None if _CHOSEN_BY_USER else _cache_folder()
_CAN_CACHE = _CHOSEN_BY_USER or _FOLDER is not None


def is_cache_empty() -> bool:
    """Whether no kernel has been compiled into the cache yet, so that this start compiles; False where nothing can be kept."""
    folder = os.environ.get("NUMBA_CACHE_DIR") or _FOLDER
    return folder is not None and next(Path(folder).rglob("*.nbi"), None) is None


def kernel(
    function: Callable[..., Any] | None = None,
    *,
    parallel: bool = False,
    inline: bool = False,
    spliced: bool = False,
    borrowing: bool = False,
) -> Any:  # noqa: ANN401
    """Compile a function of arrays with numba: nopython, exact floating point, no GIL, cached.

    Parameters
    ----------
    function : callable
        The function to compile.
    parallel : bool
        Whether ``numba.prange`` loops run on threads. Only loops whose iterations write to places of their own may,
        so that the result does not depend on the number of threads. Such a function calls kernels and does nothing else: what it
        wrote itself to arrays viewed at addresses, numba would drop as of no use.
    inline : bool
        Whether the function is inlined into its callers by LLVM (small helpers in hot loops).
    spliced : bool
        Whether numba puts the function's body into its callers before it compiles them. For thin functions around heavy ones: what
        lies below a compiled function is compiled again with every caller.
    borrowing : bool
        Whether the function only works on arrays that others hold: it makes none but by ``scratch_vector`` and ``scratch_grid``, and
        returns none but views at addresses. Nothing is counted then, where each array that is handed on is counted twice otherwise, and
        the forty of a world as well.

    Returns
    -------
    callable
        The compiled function.
    """

    def decorate(target: Callable[..., Any]) -> Any:  # noqa: ANN401
        # Division by zero gives inf or nan, as in numpy: a check before each division would keep loops off vector registers.
        options: dict[str, Any] = {"nogil": True, "fastmath": False, "error_model": "numpy", "parallel": parallel, "cache": _CAN_CACHE}
        # Told to every kernel: one that says nothing would take over what the first of its callers says.
        options["_nrt"] = not borrowing
        if inline:
            options["forceinline"] = True
        if spliced:
            options["inline"] = "always"
        previous = _numba_config.CACHE_DIR
        folder = previous if _FOLDER is None else str(_FOLDER)
        # The serial and the parallel form of one function would take each other's code from the cache, which knows no options.
        _numba_config.CACHE_DIR = os.path.join(folder, "parallel") if parallel and folder else folder
        try:
            return numba.njit(**options)(target)
        finally:
            _numba_config.CACHE_DIR = previous

    return decorate if function is None else decorate(function)


def _fill_view(context: Any, builder: Any, kind: Any, address: Any, shape: list[Any]) -> Any:  # noqa: ANN401
    """Return an array of a kind at an address that nobody counts."""
    view = context.make_array(kind)(context, builder)
    size = context.get_abi_sizeof(context.get_data_type(kind.dtype))
    strides = [context.get_constant(types.intp, size)]
    for length in reversed(shape[1:]):
        strides.insert(0, builder.mul(strides[0], length))
    pointer = builder.inttoptr(address, view.data.type)
    _numba_arrays.populate_array(
        view, data=pointer, shape=shape, strides=strides, itemsize=context.get_constant(types.intp, size), meminfo=None
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

    For some numbers a beam, not for grids: a stack holds a few megabytes. Not within a loop, which would set aside room each time.
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


def available_threads() -> int:
    """Return how many threads parallel kernels can use."""
    return int(_numba_config.NUMBA_NUM_THREADS)


def use_threads(threads: int) -> None:
    """Let parallel kernels run on so many threads of this process from now on."""
    if numba.get_num_threads() != threads:
        numba.set_num_threads(threads)
