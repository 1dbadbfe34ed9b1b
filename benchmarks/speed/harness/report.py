"""The output of the speed benchmarks: tables, and the same as JSON.

Tables come with the command, the machine and the versions.
"""

import argparse
import datetime
import os
import platform
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from lidarium.benchmarks.speed.harness.lines import Line, table
from lidarium.benchmarks.speed.harness.timing import EFFORTS, Effort, on_cores
from lidarium.benchmarks.speed.peers.catalogue import outside_versions
from lidarium.mapping.files.output import write_json, write_text

PACKAGES = ("lidarium", "numpy", "numba", "opencv-python-headless", "ir-sim", "pybullet")


def machine() -> str:
    """Say in words what this runs on."""
    model = platform.processor() or platform.machine()
    information = Path("/proc/cpuinfo")
    if information.exists():
        names = [
            line.split(":", 1)[1].strip()
            for line in information.read_text().splitlines()
            if line.startswith("model name")
        ]
        model = names[0] if names else model
    return f"{model}, {os.cpu_count()} cores, {platform.system()}"


def versions() -> dict[str, str]:
    """Return the versions of what takes part if it is installed."""
    found = {"Python": platform.python_version()}
    for package in PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            continue
    return found | outside_versions()


def about(command: str) -> dict[str, Any]:
    """Return how, when, where and with what a measurement is made."""
    date = datetime.datetime.now(datetime.UTC).date().isoformat()
    return {"command": command, "date": date, "machine": machine(), "versions": versions()}


def heading(title: str, told: Mapping[str, Any]) -> list[str]:
    """Return the first lines of a page: its title, and what ``about`` tells."""
    listed = ", ".join(f"{name} {number}" for name, number in told["versions"].items())
    return [
        f"# {title}",
        "",
        f"Measured with `{told['command']}` on {told['date']}: {told['machine']}; {listed}.",
    ]


def speed_result(lines: Sequence[Line], command: str, effort: Effort, notes: Sequence[str]) -> dict[str, Any]:
    """Return the table of speed as it is written to ``speed.json``."""
    return {
        **about(command),
        "rounds": effort.rounds,
        "block_s": effort.block_s,
        "lines": [asdict(line) | {"is_reached": line.is_reached} for line in lines],
        "notes": list(notes),
    }


def speed_page(result: Mapping[str, Any], lines: Sequence[Line]) -> str:
    """Write the table of speed as a page; ``result`` is that of ``speed_result``."""
    rounds, block_s = result["rounds"], result["block_s"]
    return "\n".join(
        [
            *heading("Speed", result),
            f"Each line is the median of {rounds} rounds in which all its contenders run in turn for "
            f"{block_s:g} s each; ratios are taken "
            "round by round, with their least and greatest. One core, and two where a line says two threads.",
            "",
            table(lines),
            "",
            "## What the lines mean",
            "",
            *(f"- {note}" for note in result["notes"]),
            "",
        ]
    )


def write_speed(result: Mapping[str, Any], lines: Sequence[Line], folder: Path) -> None:
    """Write ``speed.md`` and ``speed.json`` to a folder, which is made if absent."""
    folder.mkdir(parents=True, exist_ok=True)
    write_text(folder / "speed.md", speed_page(result, lines))
    write_json(folder / "speed.json", result)


def with_effort(parser: argparse.ArgumentParser, default: str = "full") -> argparse.ArgumentParser:
    """Add the option that says how long to measure."""
    parser.add_argument("--effort", choices=list(EFFORTS), default=default, help=f"how long to measure ({default})")
    return parser


def run_alone(measure: Callable[[Effort], list[Line]], description: str, cores: int = 1) -> None:
    """Run one question from the command line and print its lines."""
    chosen = with_effort(argparse.ArgumentParser(description=description)).parse_args()
    with on_cores(cores):
        print(table(measure(EFFORTS[chosen.effort])))
