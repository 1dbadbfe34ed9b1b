"""Runs cases one after the other in a process of its own, and tells of each on standard output.

A line ``begin N`` precedes case N, a line ``end N OUTCOME`` follows it; who reads the lines sees which case
a process died of, or never came back from. The lines ``compiling`` and ``compiled`` enclose the time in which
kernels are compiled, which is not part of any case.
"""

import json
import os
import random
import resource
import shutil
import sys
import tempfile
import time
import traceback
import warnings
from collections.abc import Callable
from pathlib import Path

from numba.core.event import Listener, register

MOST_MESSAGE = 500
AGAIN_S = 0.5
"""A file that takes longer is read again, and that is what counts: kernels may have been compiled for it."""

MEMORY = 6 << 30
"""What a worker may ask for: more is told as lack of memory [bytes]."""


def memory_mb(kind: str) -> float:
    """Return how much memory this process takes (``VmRSS``) or has taken at most (``VmHWM``) [MB]."""
    told = Path("/proc/self/status").read_text()
    return int(told.split(f"{kind}:")[1].split()[0]) / 1000


def outcome_of(action: Callable[[], object]) -> dict[str, object]:
    """Return how a case ended: ``fine``, ``refused`` by a clear error, or ``wrong``; and what it took."""
    Path("/proc/self/clear_refs").write_text("5")  # the most memory is counted anew
    held_mb, began = memory_mb("VmRSS"), time.process_time()
    try:
        action()
        found: dict[str, object] = {"kind": "fine"}
    except Exception as error:
        where = traceback.extract_tb(error.__traceback__)[-1]
        found = {"kind": "refused"}
        if not _is_clear(error, where):
            place = f"{Path(where.filename).name}:{where.lineno}"
            found = {"kind": "wrong", "error": f"{type(error).__name__}: {str(error)[:200]}", "at": place}
    found["cpu_s"] = round(time.process_time() - began, 3)
    return {**found, "mb": round(memory_mb("VmHWM") - held_mb)}


def _is_clear(error: Exception, where: traceback.FrameSummary) -> bool:
    """Whether an error is one that the package raises itself, short enough to be read."""
    is_raised = "/lidarium/" in where.filename and (where.line or "").startswith("raise")
    is_ours = isinstance(error, OSError) or (isinstance(error, ValueError) and is_raised)
    return is_ours and not isinstance(error, UnicodeError) and 0 < len(str(error)) <= MOST_MESSAGE


def file_case(samples: list[Path], folder: Path, seed: int, number: int) -> Callable[[], object]:
    """Return what reads and uses the damaged file of a case."""
    from robustness.mutations import mutated
    from robustness.uses import use

    chance = random.Random(f"{seed} {number}")
    sample = samples[number % len(samples)]
    content = mutated(sample.read_bytes(), sample.name, chance)
    path = folder / sample.name
    path.unlink(missing_ok=True)  # it may be a link to the sample
    path.write_bytes(content)
    for other in samples:  # pictures that headers name
        if other.stem == "map" and other.name != sample.name:
            (folder / other.name).unlink(missing_ok=True)
            os.link(other, folder / other.name)
    # The picture of a map is read by way of its header.
    return lambda: use(path.with_suffix(".yaml") if path.name == "map.pgm" else path)


def read_all(samples: list[Path], folder: Path) -> None:
    """Read and use all files undamaged: what is imported and loaded for it counts to no case."""
    from robustness.uses import use

    for sample in samples:
        shutil.copy(sample, folder / sample.name)
    for sample in samples:
        if sample.name != "map.pgm":
            use(folder / sample.name)


class _Compiling(Listener):
    """Prints when the compilation of a kernel, with the kernels that it calls, starts and ends."""

    depth = 0

    def on_start(self, event: object) -> None:
        if self.depth == 0:
            print("compiling", flush=True)
        self.depth += 1

    def on_end(self, event: object) -> None:
        self.depth -= 1
        if self.depth == 0:
            print("compiled", flush=True)


def setting_case(seed: int, number: int) -> Callable[[], object]:
    """Return what makes and steps an environment of extreme settings."""
    from robustness.extremes import try_settings

    return lambda: try_settings(random.Random(f"{seed} {number}"))


def main(kind: str, samples_folder: str, seed: int, first: int, last: int) -> None:
    """Run the cases of a range."""
    warnings.simplefilter("ignore")
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    register("numba:compile", _Compiling())
    samples = sorted(path for path in Path(samples_folder).iterdir() if path.is_file())
    with tempfile.TemporaryDirectory() as folder:
        print(f"begin {first}", flush=True)
        if kind == "files":
            read_all(samples, Path(folder))
        for number in range(first, last):
            print(f"begin {number}", flush=True)
            if kind == "files":
                action = file_case(samples, Path(folder), seed, number)
            else:
                action = setting_case(seed, number)
            found = outcome_of(action)
            if kind == "files" and float(str(found["cpu_s"])) > AGAIN_S:
                found = outcome_of(file_case(samples, Path(folder), seed, number))
            print(f"end {number} {json.dumps(found)}", flush=True)


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], *map(int, sys.argv[3:6]))
