"""List the kernels that a first reset compiles and that take long, each with those that it calls.

Usage: python scripts/dev/list_reset_kernels.py

It resets an environment with an empty cache, which takes a minute.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from typing import Any

from lidarium.envs.engine.first_reset import LIST
from lidarium.mapping.kernels.first_start import SWITCH, encode_type

CHILD = "--child"
LEAST_SHARE = 0.015
"""Share of all compiling that makes a kernel worth a place in the list."""


def _compiled_in_reset() -> list[dict[str, Any]]:
    """Reset an environment; return the kernels that took long, the longest first, with their callees."""
    from numba.core import event
    from numba.core.dispatcher import Dispatcher

    events: Any = event

    found: list[tuple[float, Any, Any]] = []

    class Clock(event.Listener):
        began: list[float] = []  # noqa: RUF012

        def on_start(self, _event: Any) -> None:  # noqa: ANN401
            self.began.append(time.perf_counter())

        def on_end(self, event: Any) -> None:  # noqa: ANN401
            found.append((time.perf_counter() - self.began.pop(), event.data["dispatcher"], event.data["args"]))

    import lidarium

    clock, before = Clock(), time.perf_counter()
    events.register("numba:compile", clock)
    lidarium.parallel_env().reset(seed=0)
    least = LEAST_SHARE * (time.perf_counter() - before)

    def callees(kernel: Any) -> set[Any]:  # noqa: ANN401
        names, values = kernel.py_func.__code__.co_names, kernel.py_func.__globals__
        own = {values[name] for name in names if isinstance(values.get(name), Dispatcher)}
        return own.union(*map(callees, own))

    chosen = []
    for seconds, kernel, arguments in sorted(found, key=lambda each: -each[0]):
        if seconds >= least and kernel.py_func.__module__.startswith("lidarium."):
            signature = [encode_type(each) for each in arguments]
            chosen.append((kernel, signature))
    return [
        {
            "name": _place_of(kernel),
            "signature": signature,
            "needs": [k for k, (other, _) in enumerate(chosen) if other in callees(kernel)],
        }
        for kernel, signature in chosen
    ]


def _place_of(kernel: Any) -> str:  # noqa: ANN401
    """Return ``module:name`` of a kernel; its function may have another name."""
    module = kernel.py_func.__module__
    name = next(key for key, value in vars(sys.modules[module]).items() if value is kernel)
    return f"{module}:{name}"


def _main() -> None:
    """Write the list."""
    if sys.argv[1:] == [CHILD]:
        print(json.dumps(_compiled_in_reset()))
        return
    with tempfile.TemporaryDirectory() as caches:
        environment = {**os.environ, "NUMBA_CACHE_DIR": caches, "XDG_CACHE_HOME": caches, SWITCH: "off"}
        command = [sys.executable, __file__, CHILD]
        output = subprocess.run(command, env=environment, check=True, stdout=subprocess.PIPE, text=True)
    lines = ",\n".join(json.dumps(each) for each in json.loads(output.stdout.splitlines()[-1]))
    LIST.write_text(f"[\n{lines}\n]\n")


if __name__ == "__main__":
    _main()
