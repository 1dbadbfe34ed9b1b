"""The one decorator of all numba kernels.

Arithmetic is exact, and kernels are cached where a directory can be written.

Numba caches compiled code per source file and does not see a change in another file that the kernel calls
into. The cache directory is therefore keyed by a hash of all sources with kernels and of what they import,
and of the settings of numba that change the code, such as ``NUMBA_BOUNDSCHECK``. It lies in the package's own
folder, the user's cache folder or the temporary folder: the first that this user can write to, and nobody
else.
"""

import hashlib
import os
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
from numba.core import config
from numpy.typing import NDArray

from lidarium.mapping.kernels.cache_folders import cache_folder
from lidarium.mapping.kernels.in_python.interpreted import IS_INTERPRETED, interpreted
from lidarium.mapping.kernels.kept_code import keep

# OpenMP's threads spin where they wait for each other, by default. Where others use the cores as well, as a
# learner does, two threads then take longer than one. Threads that sleep at once make the short operations of
# a network a third slower, so they spin for some microseconds. Who has said otherwise is left alone. It has
# to be said before numba loads OpenMP, which it does when the first threads start.
if "OMP_WAIT_POLICY" not in os.environ:
    os.environ["OMP_WAIT_POLICY"] = "passive"
    os.environ.setdefault("GOMP_SPINCOUNT", "2000")

Array = NDArray[Any]
"""An array in the signature of a kernel; its docstring gives shape and type."""

_numba_config: Any = config

PACKAGE_FOLDERS = ("mapping", "envs", "evaluation")
"""Folders whose kernels call each other."""

CHOICES = ("BOUNDSCHECK", "DEBUGINFO_DEFAULT", "OPT", "LOOP_VECTORIZE", "SLP_VECTORIZE")
"""Settings of numba that change compiled code, and by which its own cache does not tell it apart."""

_ROOT = Path(__file__).resolve().parents[2]
_IMPORTS = re.compile(rb"^from lidarium\.([\w.]+) import", re.MULTILINE)


def key_sources(root: Path = _ROOT) -> list[Path]:
    """Return the sources whose code or constants are in compiled kernels.

    Those are files with kernels, this package, and the modules that either imports from.
    """
    found: set[Path] = set()
    for folder in PACKAGE_FOLDERS:
        for path in (root / folder).rglob("*.py"):
            source = path.read_bytes()
            if b"@kernel" in source or path.parent.name == "kernels":
                modules = (
                    root / f"{name.decode().replace('.', '/')}.py" for name in _IMPORTS.findall(source)
                )
                found.update((path, *filter(Path.is_file, modules)))
    return sorted(found)


def _sources_hash(root: Path = _ROOT) -> str:
    digest = hashlib.sha256(numba.__version__.encode())
    digest.update(repr([getattr(_numba_config, name) for name in CHOICES]).encode())
    for path in key_sources(root):
        digest.update(path.relative_to(root).as_posix().encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def _cache_folder() -> Path | None:
    """Return the folder of the compiled kernels, or None where none is good."""
    return cache_folder("kernels", _sources_hash(), beside=Path(__file__).resolve())


_CHOSEN_BY_USER = bool(os.environ.get("NUMBA_CACHE_DIR")) and not IS_INTERPRETED
_FOLDER = None if _CHOSEN_BY_USER or IS_INTERPRETED else _cache_folder()
_CAN_CACHE = _CHOSEN_BY_USER or _FOLDER is not None


def kernel_cache() -> Path | None:
    """Return the folder of the compiled kernels, or None where nothing can be cached."""
    folder = os.environ["NUMBA_CACHE_DIR"] if _CHOSEN_BY_USER else _FOLDER
    return None if folder is None else Path(folder)


def is_cache_empty() -> bool:
    """Whether the cache holds no compiled kernel yet, so that this start compiles.

    False where nothing can be cached.
    """
    folder = kernel_cache()
    return folder is not None and next(folder.rglob("*.nbi"), None) is None


def kernel(
    function: Callable[..., Any] | None = None,
    *,
    parallel: bool = False,
    inline: bool = False,
    spliced: bool = False,
    borrowing: bool = False,
) -> Any:  # noqa: ANN401
    """Compile a function of arrays with numba.

    In nopython mode, with exact floating point, without the GIL, and cached.

    Parameters
    ----------
    function : callable
        The function to compile.
    parallel : bool
        Whether ``numba.prange`` loops run on threads. Only loops whose iterations write to places of their
        own may, so that the result does not depend on the number of threads. Such a function calls kernels
        and does nothing else: what it wrote itself to arrays viewed at addresses, numba would drop as of no
        use.
    inline : bool
        Whether the function is inlined into its callers by LLVM (small helpers in hot loops).
    spliced : bool
        Whether numba puts the function's body into its callers before it compiles them. For thin functions
        around heavy ones: what lies below a compiled function is compiled again with every caller.
    borrowing : bool
        Whether the function only works on arrays that others hold: it makes none but by ``scratch_vector``
        and ``scratch_grid``, and returns none but views at addresses. Nothing is counted then, where each
        array that is handed on is counted twice otherwise, and the forty of a world as well.

    Returns
    -------
    callable
        The compiled function.
    """
    if IS_INTERPRETED:
        return interpreted if function is None else interpreted(function)

    def decorate(target: Callable[..., Any]) -> Any:  # noqa: ANN401
        # Division by zero gives inf or nan, as in numpy: a check before each division would keep loops off
        # vector registers.
        options: dict[str, Any] = {
            "nogil": True,
            "fastmath": False,
            "error_model": "numpy",
            "parallel": parallel,
        }
        # Told to every kernel: one that says nothing would take over what the first of its callers says.
        options["_nrt"] = not borrowing
        if inline:
            options["forceinline"] = True
        if spliced:
            options["inline"] = "always"
        previous = _numba_config.CACHE_DIR
        folder = previous if _FOLDER is None else str(_FOLDER)
        # The serial and the parallel form of one function would take each other's code from the cache, which
        # knows no options.
        _numba_config.CACHE_DIR = os.path.join(folder, "parallel") if parallel and folder else folder
        try:
            compiled = numba.njit(**options)(target)
            if _CAN_CACHE:
                keep(compiled)
            return compiled
        finally:
            _numba_config.CACHE_DIR = previous

    return decorate if function is None else decorate(function)


def available_threads() -> int:
    """Return how many threads parallel kernels can use."""
    return int(_numba_config.NUMBA_NUM_THREADS)


_process_of_threads = 0


def _start_threads() -> None:
    """Start the threads of parallel kernels, and leave PyTorch as many as it had.

    Where PyTorch came first, OpenMP is one for both, and numba sets its number of threads.
    """
    torch: Any = sys.modules.get("torch")
    threads = torch.get_num_threads() if hasattr(torch, "get_num_threads") else None
    numba.get_num_threads()
    if threads is not None:
        torch.set_num_threads(threads)


def use_threads(threads: int) -> int:
    """Let parallel kernels run on so many threads, and return how many they may use.

    Parameters
    ----------
    threads : int
        How many are wanted.

    Returns
    -------
    int
        As many, or 1 in a process that was forked after threads had started. They do not live on in it, and
        a parallel kernel would wait for them forever; serial forms give the same.
    """
    global _process_of_threads  # threads belong to the process
    process = os.getpid()
    if threads <= 1:
        if _process_of_threads == process and numba.get_num_threads() != 1:
            numba.set_num_threads(1)
        return 1
    if _process_of_threads == 0:
        _process_of_threads = process
        _start_threads()
    if _process_of_threads != process:
        return 1
    if numba.get_num_threads() != threads:
        numba.set_num_threads(threads)
    return threads
