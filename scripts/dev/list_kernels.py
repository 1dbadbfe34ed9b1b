"""List the kernels that a first start compiles and that take long, each with those that it calls.

Usage: python scripts/dev/list_kernels.py run|reset [--check]

It does the default ``lidarium run``, or a reset, with an empty cache, which takes minutes. With ``--check`` it only
compares the kernels' names with those of the list.
"""

import contextlib
import json
import os
import subprocess
import sys
import tempfile
from typing import Any

from lidarium.envs.engine.beginnings import KERNELS_OF_RESET
from lidarium.mapping.kernels.first_start import SWITCH, encode_type
from lidarium.scripts.common import KERNELS_OF_RUN

LISTS = {"run": KERNELS_OF_RUN, "reset": KERNELS_OF_RESET}
CHILD = "--child"
LEAST_SHARE = 0.003
"""Kernels are listed if they and their callees take at least this share of the compile time."""


def _compiled_in(start: str) -> list[dict[str, Any]]:
    """Do a start; return the kernels that took long, the longest first, with their callees."""
    from time import process_time

    from numba.core import event
    from numba.core.dispatcher import Dispatcher

    events: Any = event

    found: list[tuple[float, Any, Any]] = []

    class Clock(event.Listener):
        began: list[float] = []  # noqa: RUF012
        seconds = 0.0

        def on_start(self, _event: Any) -> None:  # noqa: ANN401
            self.began.append(process_time())

        def on_end(self, event: Any) -> None:  # noqa: ANN401
            seconds = process_time() - self.began.pop()
            self.seconds += 0.0 if self.began else seconds
            found.append((seconds, event.data["dispatcher"], event.data["args"]))

    clock = Clock()
    events.register("numba:compile", clock)
    with tempfile.TemporaryDirectory() as folder:
        _begin(start, folder)

    def callees(kernel: Any) -> set[Any]:  # noqa: ANN401
        names, values = kernel.py_func.__code__.co_names, kernel.py_func.__globals__
        own = {values[name] for name in names if isinstance(values.get(name), Dispatcher)}
        return own.union(*map(callees, own))

    chosen: dict[tuple[str, str], tuple[Any, Any]] = {}
    for seconds, kernel, arguments in sorted(found, key=lambda each: -each[0]):
        if seconds < LEAST_SHARE * clock.seconds or not kernel.py_func.__module__.startswith("lidarium."):
            continue
        try:
            place, signature = _place_of(kernel), [encode_type(each) for each in arguments]
        except (LookupError, ValueError):  # made by a function, or called with defaults
            continue
        chosen.setdefault((place, json.dumps(signature)), (kernel, signature))
    return [
        {
            "name": place,
            "signature": signature,
            "needs": [k for k, (other, _) in enumerate(chosen.values()) if other in callees(kernel)],
        }
        for (place, _), (kernel, signature) in chosen.items()
    ]


def _begin(start: str, folder: str) -> None:
    import lidarium
    from lidarium.scripts.main import main

    if start == "reset":
        lidarium.parallel_env().reset(seed=0)
    else:
        with contextlib.redirect_stdout(sys.stderr):
            assert main(["run", "--out", f"{folder}/run"]) == 0


def _place_of(kernel: Any) -> str:  # noqa: ANN401
    """Return ``module:name`` of a kernel; its function may have another name."""
    module = kernel.py_func.__module__
    names = [key for key, value in vars(sys.modules[module]).items() if value is kernel]
    return f"{module}:{names[0]}"


def _main(start: str, option: str = "") -> None:
    if option == CHILD:
        print(json.dumps(_compiled_in(start)))
        return
    with tempfile.TemporaryDirectory() as caches:
        environment = {**os.environ, "NUMBA_CACHE_DIR": caches, "XDG_CACHE_HOME": caches, SWITCH: "off"}
        command = [sys.executable, __file__, start, CHILD]
        output = subprocess.run(command, env=environment, check=True, stdout=subprocess.PIPE, text=True)
    found = json.loads(output.stdout.splitlines()[-1])
    if option == "--check":
        listed = json.loads(LISTS[start].read_text())
        gone = sorted({each["name"] for each in listed} - {each["name"] for each in found})
        sys.exit(f"the start no longer compiles {', '.join(gone)}; write the list again" if gone else None)
    LISTS[start].write_text("[\n" + ",\n".join(json.dumps(each) for each in found) + "\n]\n")


if __name__ == "__main__":
    _main(*sys.argv[1:])
