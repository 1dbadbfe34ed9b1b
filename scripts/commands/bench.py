"""`lidarium bench`: measure speed on this machine, with other simulators that are installed for comparison."""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Literal

from lidarium.scripts.common import DONE, INTERRUPTED, NO, Answer, Command, notify, table

SLOWER = 1.05
"""Share of the other version's time from which a line counts as slower."""

BLOCKS = {"quick": (1, 6), "moderate": (2, 20), "full": (3, 40)}
"""Rounds, and blocks in a round, of a comparison with another version by effort."""


@dataclass(frozen=True, kw_only=True)
class _Bench(Command):
    """Measure the lines of the speed budget on this machine.

    Other simulators that are installed are measured, too.
    """

    compiles: ClassVar[bool] = True

    effort: Literal["quick", "moderate", "full"] = "moderate"
    """how long to measure: coarse figures, figures to read, or those to publish"""
    only: tuple[str, ...] = ()
    """questions to ask, all by default.

    Questions are kernel_step, ray_casting, range_error, map_update, exploration_projects,
    environment_step, batch_step, thread_scaling, learning_preset, waypoint_decision, frontier_decision, tour_decision,
    predicted_window, frontier_threads, masked_training, attention_training, learned_training, batch_memory,
    first_reset, cached_start, bullet_world, depth_image, quantisation, sparse_planning,
    path_server.
    """
    guard: Path | None = None
    """interpreter of an environment with another version, such as the last release.

    Both versions step in turn; lines that take over 5 % more time here are named, with exit code 3
    """


def execute(command: _Bench) -> Answer:
    """Measure, print, and write ``speed.md`` and ``speed.json`` if asked to."""
    if command.guard is not None:
        return _guard(command, command.guard)
    from lidarium.benchmarks.speed.all import QUESTIONS, ask, result_of
    from lidarium.benchmarks.speed.harness.report import write_speed
    from lidarium.benchmarks.speed.harness.timing import EFFORTS
    from lidarium.benchmarks.speed.peers.catalogue import missing_peers
    from lidarium.mapping.files.output import check_writable

    for name in command.only:
        if name not in QUESTIONS:
            raise ValueError(f"--only has the unknown question {name!r}; want some of {', '.join(QUESTIONS)}")
    names = [name for name in QUESTIONS if not command.only or name in command.only]
    if command.out is not None:
        check_writable(command.out)
    effort = EFFORTS[command.effort]
    done: list[str] = []
    lines: list[Any] = []
    is_interrupted = False
    try:
        for place, name in enumerate(names, 1):
            notify(f"measuring {name} ({place} of {len(names)})")
            lines += ask(name, effort)
            done.append(name)
    except KeyboardInterrupt:
        if not done:
            raise
        is_interrupted = True
    asked = f" --only {' '.join(command.only)}" if command.only else ""
    result = result_of(done, lines, f"lidarium bench --effort {command.effort}{asked}", effort)
    if is_interrupted:
        result["interrupted"] = True
    if command.out is not None:
        write_speed(result, lines, command.out)
    shown = table([line.cells for line in lines], ("line", "ours", "beside", "ratio", "to reach", "reached"))
    text = "\n".join([f"{result['machine']}, lidarium {result['versions']['lidarium']}", shown, *missing_peers()])
    return Answer(result, text, INTERRUPTED if is_interrupted else 0)


def _guard(command: _Bench, other: Path) -> Answer:
    """Compare this version with another one in turn; write ``guard.json`` if asked to."""
    import numpy as np

    from lidarium.benchmarks.results_page import about
    from lidarium.benchmarks.speed.against import KINDS, times
    from lidarium.mapping.files.output import check_writable, write_json

    if command.only:
        raise ValueError("--guard has lines of its own; leave out --only")
    if not other.is_file():
        raise FileNotFoundError(
            f"--guard is {other}, which is no file; want the python of an environment with lidarium"
        )
    if command.out is not None:
        check_writable(command.out)
    notify(f"stepping beside {other}")
    try:
        found = times([sys.executable, str(other)], KINDS, 1, *BLOCKS[command.effort])
    except (RuntimeError, OSError) as error:
        raise ValueError(f"--guard cannot be used: {error}") from error
    lines, rows = [], []
    for name, (ours, theirs) in found.items():
        low, ratio, high = np.quantile(ours / theirs, [0.25, 0.5, 0.75]).tolist()
        is_slower = ratio > SLOWER
        ours_us, other_us = float(np.median(ours)), float(np.median(theirs))
        lines.append({"name": name, "ours_us": ours_us, "other_us": other_us, "ratio": ratio, "is_slower": is_slower})
        judged = f"{ratio:.3f} ({low:.3f} to {high:.3f})"
        rows.append((name, f"{ours_us:.1f}", f"{other_us:.1f}", judged, "slower" if is_slower else "-"))
    slower = [line["name"] for line in lines if line["is_slower"]]
    result = {**about("lidarium bench --guard"), "other": str(other), "lines": lines, "slower": slower}
    if command.out is not None:
        command.out.mkdir(parents=True, exist_ok=True)
        write_json(command.out / "guard.json", result)
    header = ("line", "here [us]", "other [us]", "share of its time (quartiles)", "over 5 %")
    said = f"slower than the other version: {', '.join(slower)}" if slower else "no line is over 5 % slower"
    return Answer(result, f"{table(rows, header)}\n{said}", NO if slower else DONE)
