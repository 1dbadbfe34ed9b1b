"""Time to the first reset and of the first run of a new install: kernels are compiled, floors are drawn."""

import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping

from lidarium.benchmarks.speed.cases.cached_start import start
from lidarium.benchmarks.speed.harness.lines import Line
from lidarium.benchmarks.speed.harness.report import run_alone
from lidarium.benchmarks.speed.harness.timing import Effort

CORES = 2
ALLOWED_S, ALLOWED_RUN_S = 12.0, 30.0

NOTES = (
    "*First reset*: `import lidarium`, `lidarium.parallel_env()` and its first reset in a fresh process with "
    "empty caches, on two cores. *First run*: `lidarium run`, also with empty caches.",
)


def measure(effort: Effort) -> list[Line]:
    """Measure starts with empty caches, of which a full effort takes three, and a run."""
    reset_s = statistics.median(_fresh(lambda caches: start(caches).seconds) for _ in range(3 if effort.is_full else 1))
    return [
        _line("first reset with empty caches", reset_s, ALLOWED_S),
        _line("first run with empty caches", _fresh(run_seconds), ALLOWED_RUN_S),
    ]


def _line(name: str, seconds: float, allowed_s: float) -> Line:
    return Line(name, f"{seconds:.1f} s", "-", None, allowed_s, seconds, is_upper_bound=True, unit="s")


def _fresh(seconds_of: Callable[[Mapping[str, str]], float]) -> float:
    with tempfile.TemporaryDirectory() as folder:
        caches = {"NUMBA_CACHE_DIR": f"{folder}/kernels", "XDG_CACHE_HOME": f"{folder}/floors"}
        return seconds_of({**os.environ, **caches})


def run_seconds(environment: Mapping[str, str]) -> float:
    """Return how long the default run of the command line takes [s]."""
    began = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run(
            [sys.executable, "-m", "lidarium", "run", "--out", folder],
            env=environment,
            cwd=folder,
            capture_output=True,
            check=True,
        )
    return time.perf_counter() - began


if __name__ == "__main__":
    run_alone(measure, "First reset with empty caches.", CORES)
