"""Time to the first reset of a new install: all kernels that it needs are compiled, floors are drawn."""

import os
import statistics
import tempfile

from lidarium.benchmarks.speed.cases.cached_start import start
from lidarium.benchmarks.speed.harness.lines import Line
from lidarium.benchmarks.speed.harness.report import run_alone
from lidarium.benchmarks.speed.harness.timing import Effort

CORES = 2
ALLOWED_S = 25.0

NOTES = (
    "*First reset*: `import lidarium`, `lidarium.parallel_env()` and its first reset in a fresh process with "
    "empty caches, on two cores.",
)


def measure(effort: Effort) -> list[Line]:
    """Measure starts with empty caches, of which a full effort takes three."""
    seconds = statistics.median(_first_start() for _ in range(3 if effort.is_full else 1))
    return [
        Line(
            "first reset with empty caches",
            f"{seconds:.1f} s",
            "-",
            None,
            ALLOWED_S,
            seconds,
            is_upper_bound=True,
            unit="s",
        )
    ]


def _first_start() -> float:
    with tempfile.TemporaryDirectory() as folder:
        caches = {"NUMBA_CACHE_DIR": f"{folder}/kernels", "XDG_CACHE_HOME": f"{folder}/floors"}
        return start({**os.environ, **caches}).seconds


if __name__ == "__main__":
    run_alone(measure, "First reset with empty caches.", CORES)
