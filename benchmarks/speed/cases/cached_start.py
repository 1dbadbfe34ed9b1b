"""Time of a start when the kernels are compiled.

It also checks that a second start compiles nothing, wherever lidarium lies.
"""

import importlib
import json
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import lidarium
from lidarium.benchmarks.speed.harness.lines import Line
from lidarium.benchmarks.speed.harness.report import run_alone
from lidarium.benchmarks.speed.harness.timing import Effort

CORES = 1
ALLOWED_S = 0.7

NOTES = (
    "*Cached start*: `import lidarium`, `lidarium.parallel_env()` and its first reset in a fresh process, after one "
    "that has compiled the kernels. *Kernels compiled*: those of the reset and three steps that were not in the "
    "cache.",
)


@dataclass(frozen=True, slots=True)
class Start:
    """What a start in a fresh process told.

    `seconds`: import and first reset [s]; `compiled`, `loaded`: kernels that were compiled, and that came from the
    cache; `folder`: where the compiled code is kept.
    """

    seconds: float
    compiled: int
    loaded: int
    folder: str


def start(environment: Mapping[str, str] | None = None) -> Start:
    """Start once in a fresh process, in this process's environment or another."""
    program = Path(__file__).with_name("start_program.py")
    told = subprocess.run(
        [sys.executable, str(program)],
        env=environment,
        capture_output=True,
        text=True,
        check=True,
        cwd=tempfile.gettempdir(),
    ).stdout
    return Start(**json.loads(told.splitlines()[-1]))


def read_only_environment(folder: Path) -> dict[str, str]:
    """Copy the package to a folder, and return an environment that uses it.

    Only the temporary folder can be written to in that environment.

    Nothing is refused to the administrator: files in the way keep folders from being made even then.
    """
    package, home, temporary = folder / "package" / "lidarium", folder / "home", folder / "temporary"
    skipped = shutil.ignore_patterns("__pycache__")
    shutil.copytree(
        Path(lidarium.__file__).parent, package, ignore=shutil.ignore_patterns("__pycache__", *("mapping", "envs"))
    )
    for name in ("mapping", "envs"):
        shutil.copytree(importlib.import_module(f"lidarium.{name}").__path__[0], package / name, ignore=skipped)
    (package / "mapping" / "kernels" / "__pycache__").write_text("in the way")
    home.mkdir()
    (home / ".cache").write_text("in the way")
    temporary.mkdir()
    for each in (home, package, *(path for path in package.rglob("*") if path.is_dir())):
        each.chmod(0o555)
    kept = {name: value for name, value in os.environ.items() if name not in ("XDG_CACHE_HOME", "NUMBA_CACHE_DIR")}
    return {
        **kept,
        "PYTHONPATH": str(folder / "package"),
        "PYTHONDONTWRITEBYTECODE": "1",
        "HOME": str(home),
        "TMPDIR": str(temporary),
    }


def read_only_start() -> Start:
    """Start twice with a writable temporary folder only. Returned is what the second start reported."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        environment = read_only_environment(folder)
        try:
            start(environment)
            second = start(environment)
        finally:
            for each in (folder / "home", *(path for path in (folder / "package").rglob("*") if path.is_dir())):
                each.chmod(0o755)
        if not Path(second.folder).is_relative_to(folder / "temporary"):
            raise RuntimeError(f"the compiled code is kept in {second.folder}; want the temporary folder")
    return second


def measure(effort: Effort) -> list[Line]:
    """Measure the start, and count what is compiled."""
    start()
    starts = [start() for _ in range(effort.rounds)]
    seconds = statistics.median(each.seconds for each in starts)
    lines = [
        Line(
            "cached start: import and first reset",
            f"{seconds:.2f} s",
            "-",
            None,
            ALLOWED_S,
            seconds,
            is_upper_bound=True,
            unit="s",
        )
    ]
    lines.append(_compiled("kernels compiled by a second start", starts[-1]))
    if effort.is_full:
        lines.append(_compiled("kernels compiled by a second start, package and home read-only", read_only_start()))
    return lines


def _compiled(name: str, told: Start) -> Line:
    return Line(
        name,
        f"{told.compiled} ({told.loaded} loaded)",
        "-",
        None,
        0.0,
        float(told.compiled),
        is_upper_bound=True,
        unit="kernels",
    )


if __name__ == "__main__":
    run_alone(measure, "Starts with compiled kernels.")
