"""Run all speed benchmarks in one go and write docs/results/speed.md and speed.json.

The peers take part where they are installed: IR-SIM and PyBullet in this interpreter (``pip install ".[bench]"``), VMAS in
this one or in the interpreter that LIDARIUM_VMAS_PYTHON names, f1tenth's scan simulator from the file that LIDARIUM_F1TENTH
names. Everything runs in turn on one core.
"""

import argparse
from pathlib import Path

import environment_step
import exploration_projects
import kernel_step
import map_update
import range_error
import ray_casting
from peers.vmas_peer import interpreter, package_version
from report import Line, table, write
from timing import QUICK, Effort, pin

QUESTIONS = (kernel_step, ray_casting, range_error, map_update, exploration_projects, environment_step)
RESULTS = Path(__file__).resolve().parents[2] / "docs" / "results"

ABOUT_QUOTES = (
    "*quoted* marks a rate that was not measured in this run but on an AMD Zen 5 core of about 4.1 GHz; on another machine read "
    "those ratios with that in mind.",
)


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description="All speed benchmarks in one run.")
    parser.add_argument("--quick", action="store_true", help="few short rounds: about a minute, coarse figures")
    parser.add_argument("--out", type=Path, default=RESULTS, help="folder of speed.md and speed.json")
    arguments = parser.parse_args()
    effort = QUICK if arguments.quick else Effort()
    pin()
    lines: list[Line] = []
    for question in QUESTIONS:
        measured = question.measure(effort)
        print(f"{question.__name__}\n\n{table(measured)}\n", flush=True)
        lines += measured
    notes = tuple(note for question in QUESTIONS for note in question.NOTES) + ABOUT_QUOTES
    vmas = package_version() if interpreter() is not None else None
    command = "python benchmarks/speed/all.py" + (" --quick" if arguments.quick else "")
    write(lines, arguments.out, command, effort, {} if vmas is None else {"vmas": vmas}, notes)
    missed = [line.name for line in lines if line.is_reached is False]
    print(f"{len(lines)} lines written to speed.md and speed.json; not reached: {len(missed)}")


if __name__ == "__main__":
    main()
