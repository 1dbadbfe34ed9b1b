"""List the kernels that ``lidarium run`` calls, for the first start to compile side by side.

Usage: python scripts/dev/list_kernels.py [--check]

It runs ``lidarium run`` with empty caches, which takes minutes, then again: kernels that the second run loads from
the cache are those that Python calls. With ``--check`` it runs with the existing caches, and only compares.
"""

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from types import ModuleType
from typing import Any

from lidarium.mapping.kernels.first_start import encode_type
from lidarium.scripts.first_start import LIST, count_compiled

CHILD = "--child"


def called_kernels(modules: Mapping[str, ModuleType]) -> list[dict[str, Any]]:
    """Return the kernels of modules that this process has called from Python, largest machine code first."""
    from numba.core.dispatcher import Dispatcher

    found = [
        (_code_size(value), {"name": f"{name}:{key}", "signature": [encode_type(each) for each in signature]})
        for name, module in sorted(modules.items())
        if name.startswith("lidarium.")
        for key, value in vars(module).items()
        if isinstance(value, Dispatcher) and value.__module__ == name
        for signature in value.signatures
    ]
    return [entry for _, entry in sorted(found, key=lambda each: -each[0])]


def _code_size(kernel: Any) -> int:  # noqa: ANN401
    """Return the bytes of a kernel's machine code with all that it calls: how long compiling takes."""
    folder = kernel.stats.cache_path
    if folder is None:  # it cannot be cached
        return 0
    stem = f"{kernel.__module__.rpartition('.')[2]}.{kernel.py_func.__qualname__}-"
    return max((path.stat().st_size for path in Path(folder).glob(f"{stem}*.nbc")), default=0)


def _run_and_list(caches: Path | None) -> list[dict[str, Any]]:
    """Run ``lidarium run`` in a process of its own and return the kernels that it called."""
    with tempfile.TemporaryDirectory() as folder:
        # A floor that is not in the user's cache: some kernels draw floors.
        environment = {**os.environ, "XDG_CACHE_HOME": f"{folder}/floors"}
        if caches is not None:
            environment["NUMBA_CACHE_DIR"] = str(caches)
        command = [sys.executable, __file__, CHILD, folder]
        output = subprocess.run(command, env=environment, check=True, stdout=subprocess.PIPE, text=True)
    return list(json.loads(output.stdout.splitlines()[-1]))


def _child(folder: str) -> None:
    from lidarium.scripts import first_start
    from lidarium.scripts.main import main

    first_start.compile_first = lambda is_quiet: None
    assert main(["run", "--out", f"{folder}/run"]) == 0
    print(json.dumps(called_kernels(sys.modules)))


def _write() -> None:
    with tempfile.TemporaryDirectory() as caches:
        _run_and_list(Path(caches))
        compiled = count_compiled(Path(caches))
        kernels = _run_and_list(Path(caches))
    lines = ",\n".join(json.dumps(each) for each in kernels)
    LIST.write_text(f'{{"compiled": {compiled}, "kernels": [\n{lines}\n]}}\n')


def _is_current() -> bool:
    def by_name(kernels: list[dict[str, Any]]) -> list[str]:
        return sorted(json.dumps(each) for each in kernels)

    return by_name(json.loads(LIST.read_text())["kernels"]) == by_name(_run_and_list(None))


if __name__ == "__main__":
    if CHILD in sys.argv:
        _child(sys.argv[-1])
    elif "--check" in sys.argv:
        sys.exit(None if _is_current() else f"{LIST} is stale; run python scripts/dev/list_kernels.py")
    else:
        _write()
