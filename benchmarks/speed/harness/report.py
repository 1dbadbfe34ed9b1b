"""The output of the speed benchmarks: tables, and the same as JSON."""

import argparse
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from lidarium.benchmarks.results_page import about, in_file, publish
from lidarium.benchmarks.speed.harness.lines import Line, table
from lidarium.benchmarks.speed.harness.timing import EFFORTS, Effort, on_cores
from lidarium.benchmarks.speed.peers.catalogue import outside_versions
from lidarium.mapping.files.output import write_json


def speed_result(lines: Sequence[Line], command: str, effort: Effort, notes: Sequence[str]) -> dict[str, Any]:
    """Return the table of speed as it is written to ``speed.json``."""
    return {
        **about(command, outside_versions()),
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
            "# Speed",
            f"Medians of {rounds} rounds in which all contenders of a line run in turn for {block_s:g} s each; ratios "
            "are taken round by round, with their least and greatest. One core, or two if a line says two threads.",
            "",
            in_file(table(lines)),
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
    publish(folder / "speed.md", speed_page(result, lines), result)
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
