"""`lidarium bench`: measure speed on this machine, with other simulators that are installed for comparison."""

from dataclasses import dataclass
from typing import Any, ClassVar, Literal

from lidarium.scripts.common import INTERRUPTED, Answer, Command, notify, table


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
    environment_step, batch_step, learning_preset, waypoint_decision, frontier_decision,
    frontier_threads, masked_training, attention_training, learned_training, first_reset, cached_start,
    bullet_world, depth_image, quantisation, sparse_planning,
    path_server.
    """


def execute(command: _Bench) -> Answer:
    """Measure, print, and write ``speed.md`` and ``speed.json`` if asked to."""
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
