"""The decorator of all numba kernels, their cache, and how Python runs them without a compiler.

Arithmetic is exact, and kernels are cached if a directory can be written.

Numba caches compiled code per source file and does not notice a change in another file that the kernel calls
into. The cache directory is therefore keyed by a hash of all sources with kernels, of their imports, and of
the settings of numba that change the code, such as ``NUMBA_BOUNDSCHECK``. It lies in the package's own
folder, the user's cache folder or the temporary folder: the first that only this user can write to.

With ``NUMBA_DISABLE_JIT=1`` Python runs kernels as they are written: for debugging only, and thousands of
times slower. Kernels expect numba's numbers: an element of an array of small integers does not overflow, and
a division by zero gives inf or nan. Python's numbers differ, so each kernel gets its arrays as ``Numbers``.
"""

import functools
import gc
import hashlib
import importlib
import os
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import llvmlite.binding
import numba
import numpy as np
from numba.core import config, event
from numba.core.caching import CompileResultCacheImpl, FunctionCache
from numba.core.codegen import JITCodeLibrary
from numpy.typing import NDArray

from lidarium.mapping.kernels.cache_folders import cache_folder

# By default, OpenMP's threads spin while they wait for each other. If other programs use the cores as well,
# as a learner does, two threads then take longer than one. Threads that sleep at once make the short
# operations of a network a third slower, so they spin for some microseconds, unless the user has set the
# policy. It has to be set before numba loads OpenMP, which it does when the first threads start.
if "OMP_WAIT_POLICY" not in os.environ:
    os.environ["OMP_WAIT_POLICY"] = "passive"
    os.environ.setdefault("GOMP_SPINCOUNT", "2000")

Array = NDArray[Any]
"""An array in the signature of a kernel; its docstring gives shape and type."""

_numba_config: Any = config
_caching: Any = FunctionCache
_rebuilding: Any = CompileResultCacheImpl
_libraries: Any = JITCodeLibrary
_events: Any = event
_llvm: Any = llvmlite.binding

IS_INTERPRETED = bool(_numba_config.DISABLE_JIT)
"""Whether Python runs the kernels, as they are written."""

PACKAGE_FOLDERS = ("mapping", "envs", "evaluation")
"""Folders whose kernels call each other."""

NUMBA_SETTINGS = ("BOUNDSCHECK", "DEBUGINFO_DEFAULT", "OPT", "LOOP_VECTORIZE", "SLP_VECTORIZE")
"""Settings of numba that change compiled code and that its own cache ignores."""

_ROOT = Path(__file__).resolve().parents[2]


def key_sources(root: Path = _ROOT) -> list[Path]:
    """Return the sources of compiled kernels: files with kernels, this package, and their imports."""
    found, imported = set[Path](), set[bytes]()
    for folder in PACKAGE_FOLDERS:
        for place, folders, names in os.walk(root / folder):
            folders[:] = [name for name in folders if name != "__pycache__"]  # it may hold all compiled kernels
            for path in (Path(place, name) for name in names if name.endswith(".py")):
                source = path.read_bytes()
                if b"@kernel" in source or "kernels" in path.parts:
                    found.add(path)
                    imported.update(line.partition(b" ")[0] for line in (b"\n" + source).split(b"\nfrom lidarium.")[1:])
    modules = (root / f"{name.decode().replace('.', '/')}.py" for name in imported)
    return sorted(found.union(filter(Path.is_file, modules)))


def _sources_hash(root: Path = _ROOT) -> str:
    digest = hashlib.sha256(numba.__version__.encode())
    digest.update(repr([getattr(_numba_config, name) for name in NUMBA_SETTINGS]).encode())
    for path in key_sources(root):
        digest.update(path.relative_to(root).as_posix().encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def _cache_folder() -> Path | None:
    """Return the folder of the compiled kernels, or None if none is safe."""
    return cache_folder("kernels", _sources_hash(), beside=Path(__file__).resolve())


_CHOSEN_BY_USER = bool(os.environ.get("NUMBA_CACHE_DIR")) and not IS_INTERPRETED
_FOLDER = None if _CHOSEN_BY_USER or IS_INTERPRETED else _cache_folder()
_CAN_CACHE = _CHOSEN_BY_USER or _FOLDER is not None


def kernel_cache() -> Path | None:
    """Return the folder of the compiled kernels, or None if nothing can be cached."""
    folder = os.environ["NUMBA_CACHE_DIR"] if _CHOSEN_BY_USER else _FOLDER
    return None if folder is None else Path(folder)


def is_cache_empty() -> bool:
    """Whether the cache holds no compiled kernel yet, so that this start compiles; False without a cache."""
    folder = kernel_cache()
    return folder is not None and next(folder.rglob("*.nbi"), None) is None


def kernel(
    function: Callable[..., Any] | None = None,
    *,
    parallel: bool = False,
    forceinline: bool = False,
    inline: str = "never",
    nrt: bool = True,
) -> Any:  # noqa: ANN401
    """Compile a function with ``numba.njit``: with exact floating point, without the GIL, and cached."""
    if IS_INTERPRETED:
        return _interpreted if function is None else _interpreted(function)

    def decorate(target: Callable[..., Any]) -> Any:  # noqa: ANN401
        options: dict[str, Any] = {
            "nogil": True,
            "fastmath": False,
            # Division by zero gives inf or nan, as in numpy: a check before each division would keep loops
            # off vector registers.
            "error_model": "numpy",
            "parallel": parallel,
            "inline": inline,
            # Passed to every kernel: one without it would take over the choice of the first of its callers.
            "_nrt": nrt,
            "no_cfunc_wrapper": True,  # no kernel is passed to another one as a value
        }
        if forceinline:
            options["forceinline"] = True
        previous = _numba_config.CACHE_DIR
        folder = previous if _FOLDER is None else str(_FOLDER)
        # The serial and the parallel form of one function would take each other's code from the cache, which
        # ignores options.
        _numba_config.CACHE_DIR = os.path.join(folder, "parallel") if parallel and folder else folder
        try:
            compiled = numba.njit(**options)(target)
            if _CAN_CACHE:
                _keep(compiled)
            _choose_linking(compiled)
            return compiled
        finally:
            _numba_config.CACHE_DIR = previous

    return decorate if function is None else decorate(function)


# -- Kernels that call others ------------------------------------------------------------------------------

# numba links a kernel's code into each of its callers and optimizes it there again, so that code deep in a tree of
# calls is optimized at each level. Here only short kernels are linked. Long ones are called by the names of their
# machine code, which are published before a caller is compiled, or loaded from the cache.

LONGEST_LINKED = 16_384
"""Bitcode of a kernel up to which its callers link it [bytes]."""

_by_origin: dict[tuple[str, str, bool], Any] = {}


class _Callee:
    """A compiled kernel as numba links it into a caller: with its code or, if that is long, without."""

    def __init__(self, compiled: Any, form: Any) -> None:  # noqa: ANN401
        self._form, self._module = form, form.library._get_module_for_linking
        self._kinds = tuple(form.signature.args)
        self._origin = _origin_of(compiled)

    def _ensure_finalized(self) -> None:
        pass

    @functools.cached_property
    def _is_long(self) -> bool:
        if self._origin not in _by_origin:
            return False
        return len(getattr(self._form.library, "bitcode", None) or self._module().as_bitcode()) > LONGEST_LINKED

    @property
    def _reload_init(self) -> set[Callable[[], None]]:
        """Functions that a caller runs when it is loaded from the cache."""
        if not self._is_long:
            return set(self._form.library._reload_init)
        return {functools.partial(_reach, self._origin, self._kinds, self._form.fndesc.llvm_func_name)}

    def _get_module_for_linking(self) -> Any:  # noqa: ANN401
        if not self._is_long:
            return self._module()
        _publish(self._form, self._form.fndesc.llvm_func_name)
        return _llvm.parse_assembly("")


def _origin_of(compiled: Any) -> tuple[str, str, bool]:  # noqa: ANN401
    """Return where a function is defined, and which form of it is compiled."""
    function = compiled.py_func
    return function.__module__, function.__qualname__, bool(compiled.targetoptions["parallel"])


def _choose_linking(compiled: Any) -> None:  # noqa: ANN401
    """Have callers of a kernel link it or, if it is long, call it by name."""
    is_inline = compiled.targetoptions.get("forceinline", False)
    if not is_inline and "<locals>" not in compiled.py_func.__qualname__:  # others are not found again
        _by_origin[_origin_of(compiled)] = compiled
    add_overload = compiled.add_overload

    def add(form: Any) -> None:  # noqa: ANN401
        add_overload(form)
        context = compiled.targetctx
        context.remove_user_function(form.entry_point)
        context.insert_user_function(form.entry_point, form.fndesc, [_Callee(compiled, form)])

    compiled.add_overload = add


def _reach(origin: tuple[str, str, bool], kinds: tuple[Any, ...], symbol: str) -> None:
    """Have a kernel compiled or loaded, and known by the name under which a cached caller calls it."""
    importlib.import_module(origin[0])
    compiled = _by_origin[origin]
    compiled.compile(kinds)
    _publish(compiled.overloads[kinds], symbol)


def _publish(form: Any, symbol: str) -> None:  # noqa: ANN401
    _llvm.add_symbol(symbol, form.library.get_pointer_to_function(form.fndesc.llvm_func_name))


class _WithoutCollection(_events.Listener):
    """Keeps Python's garbage collector from running while kernels compile, which takes a tenth of that time."""

    depth = 0  # a kernel compiles those that it calls
    was_enabled = False

    def on_start(self, _event: Any) -> None:  # noqa: ANN401
        """Stop collecting."""
        if self.depth == 0:
            self.was_enabled = gc.isenabled()
            gc.disable()
        self.depth += 1

    def on_end(self, _event: Any) -> None:  # noqa: ANN401
        """Collect as before, after the outermost kernel."""
        self.depth -= 1
        if self.depth == 0 and self.was_enabled:
            gc.enable()


_events.register("numba:compile", _WithoutCollection())


# -- Cache -------------------------------------------------------------------------------------------------


class _LoadedLibrary(_libraries):
    """A kernel's machine code from the cache. Numba parses its bitcode at once; here a caller that links it does."""

    def __init__(self, codegen: Any, state: tuple[str, str, tuple[bytes, bytes]]) -> None:  # noqa: ANN401
        name, _, (self._code, self.bitcode) = state
        super().__init__(codegen, name)
        self.enable_object_caching()
        self._set_compiled_object(self._code)
        self._finalize_final_module()

    @functools.cached_property
    def _module(self) -> Any:  # noqa: ANN401
        try:
            return _llvm.parse_bitcode(self.bitcode)
        except RuntimeError as error:
            raise RuntimeError(
                f"the compiled kernel {self.name} in {kernel_cache()} is damaged: {str(error)[:200]}; delete the folder"
            ) from error

    def _get_module_for_linking(self) -> Any:  # noqa: ANN401
        return self._module

    def get_pointer_to_function(self, name: str) -> int:
        """Return the address of a function, 0 if the code has none of that name."""
        self._ensure_finalized()
        return int(self._codegen._engine.get_function_address(name)) if name.encode() in self._code else 0


class _Rebuilding(_rebuilding):
    """Loads cached kernels as numba does, but into libraries that do not parse bitcode at once."""

    def rebuild(self, target_context: Any, payload: Any) -> Any:  # noqa: ANN401
        """Return the compiled form."""
        codegen = target_context.codegen()
        before = codegen.unserialize_library  # a kernel loads those that it calls
        codegen.unserialize_library = functools.partial(_LoadedLibrary, codegen)
        try:
            return super().rebuild(target_context, payload)
        finally:
            codegen.unserialize_library = before


class _KernelCache(_caching):
    """Numba's cache of a function that survives full disks, closed folders and damaged files."""

    _impl_class = _Rebuilding

    def load_overload(self, sig: Any, target_context: Any) -> Any:  # noqa: ANN401
        """Return the compiled form for types of arguments, or None if there is none or it is damaged."""
        try:
            found = super().load_overload(sig, target_context)
            if found is not None:  # numba leaves out what callers of a loaded kernel have to do when they are loaded
                found.library._reload_init.update(found.reload_init or ())
            return found
        except Exception:  # unpickling damaged bytes can raise anything
            self._forget()
            return None

    def save_overload(self, sig: Any, data: Any) -> None:  # noqa: ANN401
        """Keep a compiled form, if that is possible."""
        try:
            super().save_overload(sig, data)
        except OSError as error:
            _warn_once(error)

    def _forget(self) -> None:
        """Begin the index of the function anew."""
        try:
            self.flush()
        except OSError as error:
            self.disable()
            _warn_once(error)


_has_warned = False


def _warn_once(reason: Exception) -> None:
    """Warn that compiled code cannot be kept, once in a process."""
    global _has_warned  # one warning for hundreds of kernels
    if not _has_warned:
        _has_warned = True
        warnings.warn(
            f"compiled kernels cannot be kept and are compiled at each start: {str(reason)[:300]}; make room "
            "there, or name another folder in NUMBA_CACHE_DIR",
            stacklevel=2,
        )


def _keep(compiled: Any) -> None:  # noqa: ANN401
    """Keep the compiled forms of a function in files, if there is a folder for them."""
    try:
        compiled._cache = _KernelCache(compiled.py_func)  # numba has no public way
    except (RuntimeError, OSError) as error:  # no folder can be made
        _warn_once(error)


# -- Without a compiler ------------------------------------------------------------------------------------


class Numbers(np.ndarray[Any, Any]):
    """An array whose single elements are read as kernels expect them."""

    def __getitem__(self, index: Any) -> Any:  # noqa: ANN401
        """Return a part, or an element as a number of full width."""
        found = super().__getitem__(index)
        return found if isinstance(found, np.ndarray) else _widened(found)


def _widened(value: Any) -> Any:  # noqa: ANN401
    """Return an argument or an element as compiled kernels take it.

    Integers except uint64 become Python's, Python's floats float64, arrays ``Numbers``; float32 stays.
    """
    if isinstance(value, np.ndarray):
        return value if isinstance(value, Numbers) else value.view(Numbers)
    if isinstance(value, tuple):
        members = [_widened(each) for each in value]
        return type(value)(*members) if hasattr(value, "_fields") else tuple(members)
    if isinstance(value, float):
        return np.float64(value)
    if isinstance(value, (np.integer, np.bool_)) and not isinstance(value, np.uint64):
        return value.item()
    return value


def _interpreted(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a kernel that Python runs."""

    @functools.wraps(function)
    def call(*given: Any, **named: Any) -> Any:  # noqa: ANN401
        with np.errstate(all="ignore"):
            return function(*map(_widened, given), **{name: _widened(each) for name, each in named.items()})

    return call


# -- Threads -----------------------------------------------------------------------------------------------


def available_threads() -> int:
    """Return the maximum number of threads of parallel kernels."""
    return int(_numba_config.NUMBA_NUM_THREADS)


_process_of_threads = 0


def _start_threads() -> None:
    """Start the threads of parallel kernels, and keep PyTorch's number of threads.

    If PyTorch came first, both share one OpenMP, and numba sets its number of threads.
    """
    torch: Any = sys.modules.get("torch")
    threads = torch.get_num_threads() if hasattr(torch, "get_num_threads") else None
    numba.get_num_threads()
    if threads is not None:
        torch.set_num_threads(threads)


def use_threads(threads: int) -> int:
    """Set the number of threads of parallel kernels; return the number they may use.

    It is 1 in a process that was forked after threads had started. They do not exist there, and a parallel kernel
    would wait for them forever; serial forms give the same.
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
