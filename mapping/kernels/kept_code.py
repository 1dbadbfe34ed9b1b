"""Compiled code that is kept in files where that works, and never ends a command where it does not.

Numba's own cache raises where a disk is full, a folder can no longer be written to or a file is damaged.
"""

import warnings
from typing import Any

from numba.core.caching import FunctionCache

_caching: Any = FunctionCache
_has_warned = False


def warn_once(reason: Exception) -> None:
    """Warn that compiled code cannot be kept, once in a process."""
    global _has_warned  # one warning for hundreds of kernels
    if not _has_warned:
        _has_warned = True
        warnings.warn(
            f"compiled kernels cannot be kept and are compiled at each start: {str(reason)[:300]}; make room "
            "there, or name another folder in NUMBA_CACHE_DIR",
            stacklevel=2,
        )


class KeptCode(_caching):
    """The compiled forms of a function, as numba keeps them in files."""

    def load_overload(self, sig: Any, target_context: Any) -> Any:  # noqa: ANN401
        """Return the compiled form for some types of arguments, or None where there is none that is whole."""
        try:
            return super().load_overload(sig, target_context)
        except Exception:  # what unpickling damaged bytes raises is anything
            self._forget()
            return None

    def save_overload(self, sig: Any, data: Any) -> None:  # noqa: ANN401
        """Keep a compiled form, if that is possible."""
        try:
            super().save_overload(sig, data)
        except OSError as error:
            warn_once(error)

    def _forget(self) -> None:
        """Begin the index of the function anew."""
        try:
            self.flush()
        except OSError as error:
            self.disable()
            warn_once(error)


def keep(compiled: Any) -> None:  # noqa: ANN401
    """Keep the compiled forms of a function in files from now on, where there is a folder for it."""
    try:
        compiled._cache = KeptCode(compiled.py_func)  # numba has no public way
    except (RuntimeError, OSError) as error:  # no folder can be made
        warn_once(error)
