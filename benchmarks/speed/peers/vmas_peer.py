"""VMAS as a peer: an outside program.

It is started in an interpreter that has it, and asked for one block of steps at a time.
"""

import importlib.util
import json
import math
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType

import numpy as np
from numpy.typing import NDArray

INTERPRETER = "LIDARIUM_VMAS_PYTHON"

BATCHES = (1, 32, 128)
"""Batch sizes of which the best is taken."""

_WRONG = f"{INTERPRETER} is {{}}, which gives no answer; want a Python interpreter with vmas and torch"

# glibc otherwise hands VMAS's large temporaries back to the system after every operation, which slows it
# down.
MEMORY = {"MALLOC_MMAP_MAX_": "0", "MALLOC_TRIM_THRESHOLD_": "20000000000"}


def interpreter() -> str | None:
    """Return the Python that runs VMAS. It is the one that the environment names, else this one if it has VMAS."""
    named = os.environ.get(INTERPRETER)
    if named:
        return named
    return sys.executable if importlib.util.find_spec("vmas") is not None else None


def is_there() -> bool:
    """Whether there is an interpreter to ask; it shows later whether it has VMAS."""
    return interpreter() is not None


def package_version() -> str:
    """Return the version of VMAS in its interpreter."""
    python = interpreter()
    assert python is not None
    program = "from importlib.metadata import version; print(version('vmas'))"
    try:
        return subprocess.run([python, "-c", program], capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError) as error:
        raise ValueError(_WRONG.format(python)) from error


class VmasProcess:
    """VMAS on a floor of boxes; a contender of ``timing.interleaved``.

    `boxes` (B, 4) float64: the floor [m]; `poses` (A, 3) float64: where the agents of each environment start [m, rad];
    `is_there`: whether VMAS could be started; `name`: what it is, with its version and batch size.
    """

    def __init__(
        self,
        boxes: NDArray[np.float64],
        poses: NDArray[np.float64],
        rays: int,
        reach: float,
        field_of_view: float = math.radians(240.0),
        threads: int = 1,
        batches: Sequence[int] = BATCHES,
    ) -> None:
        self.is_there, self.name = False, f"VMAS, {rays} rays"
        self._process: subprocess.Popen[str] | None = None
        python = interpreter()
        if python is None:
            return
        program = Path(__file__).parent / "outside" / "vmas_program.py"
        self._process = subprocess.Popen(
            [python, str(program)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, **MEMORY},
        )
        request = {
            "boxes": boxes.tolist(),
            "poses": poses.tolist(),
            "rays": rays,
            "reach": reach,
            "field_of_view": field_of_view,
            "threads": threads,
            "batches": list(batches),
        }
        about = json.loads(self._ask(json.dumps(request)))
        self.is_there = True
        self.name = f"VMAS {about['vmas']}, {rays} rays, batch {about['batch']}"

    def _ask(self, line: str) -> str:
        assert self._process is not None
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(line + "\n")
        self._process.stdin.flush()
        answer = self._process.stdout.readline()
        if not answer:
            raise ValueError(_WRONG.format(interpreter()))
        return answer

    def run(self, seconds: float) -> float:
        """Run for about so long and return the seconds per agent and step."""
        return float(self._ask(repr(seconds)))

    def __enter__(self) -> "VmasProcess":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._process is not None:
            assert self._process.stdin is not None
            self._process.stdin.close()
            self._process.wait(timeout=30)
