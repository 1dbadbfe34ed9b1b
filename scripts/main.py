"""The command line.

It reads what is asked for, runs it, and converts the outcome into exit codes.
"""

import sys
import traceback
from collections.abc import Callable, Sequence
from typing import Annotated, Any

from tyro.conf import subcommand

import lidarium
from lidarium.scripts import (
    animate,
    bench,
    evaluate,
    floors,
    merge,
    replay,
    report,
    reproduce,
    run,
    show,
    slam,
)
from lidarium.scripts.animate import Animate
from lidarium.scripts.bench import Bench
from lidarium.scripts.bounds import bound
from lidarium.scripts.common import (
    BAD_INPUT,
    DEFECT,
    DONE,
    INTERRUPTED,
    Answer,
    Command,
    announce_compiling,
    notify,
)
from lidarium.scripts.evaluate import Evaluate
from lidarium.scripts.floors import Floors
from lidarium.scripts.merge import Merge
from lidarium.scripts.options.supervisor import gathered
from lidarium.scripts.process.signals import (
    code_of,
    end_all_workers,
    heard_termination,
    leave_at_the_next,
)
from lidarium.scripts.process.streams import flush_streams, open_closed_streams, print_result, silence
from lidarium.scripts.replay import Replay
from lidarium.scripts.report import Report
from lidarium.scripts.reproduce import Reproduce
from lidarium.scripts.run import Run
from lidarium.scripts.show import Show
from lidarium.scripts.slam import Slam
from lidarium.scripts.sparse import edit_map, plan, sparse_map
from lidarium.scripts.training import train

Choice = (
    Annotated[Run, subcommand("run")]
    | Annotated[Evaluate, subcommand("evaluate")]
    | Annotated[Report, subcommand("report")]
    | Annotated[Reproduce, subcommand("reproduce")]
    | Annotated[Replay, subcommand("replay")]
    | Annotated[Animate, subcommand("animate")]
    | Annotated[Merge, subcommand("merge")]
    | Annotated[Slam, subcommand("slam")]
    | Annotated[sparse_map.SparseMapping, subcommand("sparse-map")]
    | Annotated[edit_map.EditSparseMap, subcommand("sparse-map-edit")]
    | Annotated[plan.Plan, subcommand("plan")]
    | Annotated[bound.Bound, subcommand("bound")]
    | Annotated[train.Train, subcommand("train")]
    | Annotated[Floors, subcommand("floors")]
    | Annotated[Bench, subcommand("bench")]
    | Annotated[Show, subcommand("show")]
)

_EXECUTE: dict[type, Callable[[Any], Answer]] = {
    Run: run.execute,
    Evaluate: evaluate.execute,
    Report: report.execute,
    Reproduce: reproduce.execute,
    Replay: replay.execute,
    Animate: animate.execute,
    Merge: merge.execute,
    Slam: slam.execute,
    sparse_map.SparseMapping: sparse_map.execute,
    edit_map.EditSparseMap: edit_map.execute,
    plan.Plan: plan.execute,
    bound.Bound: bound.execute,
    train.Train: train.execute,
    floors.List: floors.list_floors,
    floors.Show: floors.show_floor,
    floors.Generate: floors.generate_floor,
    floors.Import: floors.import_floor,
    floors.Prepare: floors.prepare_floors,
    Bench: bench.execute,
    Show: show.execute,
}

_IN_TWO_WORDS = {("sparse-map", "edit"): "sparse-map-edit"}
"""Commands in two words, the first of which is a command of its own that takes files."""

_WITH_KERNELS = (
    Run,
    Evaluate,
    Reproduce,
    Animate,
    Merge,
    Slam,
    sparse_map.SparseMapping,
    edit_map.EditSparseMap,
    plan.Plan,
    bound.Bound,
    train.Train,
    floors.Prepare,
    Bench,
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command.

    Parameters
    ----------
    arguments : sequence of str or None
        Those of the process where None.

    Returns
    -------
    int
        Exit code: 0 done, 2 bad input, 3 the answer is no, 130 interrupted by Ctrl-C and 143 by SIGTERM
        (finished parts are kept), 1 a defect of ours.
    """
    is_process = arguments is None
    if is_process:
        open_closed_streams()
    with heard_termination() as termination:
        try:
            code = _ended(arguments)
        except KeyboardInterrupt:
            code = INTERRUPTED
            notify("interrupted")
        if code == INTERRUPTED:
            code = code_of(termination.is_asked)
            if is_process:
                leave_at_the_next(code)
            end_all_workers()
    if is_process:
        flush_streams()
    return code


def _ended(arguments: Sequence[str] | None) -> int:
    """Run a command; return its exit code, errors included."""
    if list(sys.argv[1:] if arguments is None else arguments) == ["--version"]:
        print_result(f"lidarium {lidarium.__version__}\n")
        return DONE
    try:
        return _answered(_command(arguments))
    except SystemExit as leaving:  # tyro, having printed help (0) or what is wrong with the options (2)
        return leaving.code if isinstance(leaving.code, int) else BAD_INPUT
    except (ValueError, OSError) as error:
        notify(f"lidarium: {_message(error)}")
        return BAD_INPUT
    except MemoryError:
        notify(
            "lidarium: this needs more memory than there is; try a smaller floor, a coarser --resolution or "
            "--map-resolution"
        )
        return BAD_INPUT
    except Exception as error:
        from lidarium.evaluation.episodes.interrupts import is_wrapped_interrupt

        if is_wrapped_interrupt(error):
            raise KeyboardInterrupt from error
        notify(
            "lidarium: this is a defect of lidarium, not of your input. Please report it with the command "
            "line and the lines below.\n"
        )
        notify(traceback.format_exc())
        return DEFECT


def _command(arguments: Sequence[str] | None) -> Command:
    import tyro

    words = list(sys.argv[1:] if arguments is None else arguments)
    if tuple(words[:2]) in _IN_TWO_WORDS:
        words[:2] = [_IN_TWO_WORDS[words[0], words[1]]]
    words = gathered(words)
    config = (tyro.conf.OmitArgPrefixes, tyro.conf.OmitSubcommandPrefixes, tyro.conf.FlagCreatePairsOff)
    description = (
        "Teams of lidar robots explore unknown floors. Begin with `lidarium run`; "
        "`lidarium --version` is the version."
    )
    try:
        chosen: Any = tyro.cli(Choice, prog="lidarium", description=description, args=words, config=config)
    except BrokenPipeError as error:  # nobody reads the help to its end
        silence(sys.stdout)
        raise SystemExit(DONE) from error
    command: Command = chosen.command if isinstance(chosen, Floors) else chosen
    return command


def _answered(command: Command) -> int:
    from lidarium.evaluation.episodes.output import as_json

    if isinstance(command, _WITH_KERNELS):
        announce_compiling()
    answer = _EXECUTE[type(command)](command)
    if answer.result:
        print_result(as_json(answer.result) if command.json else answer.text + "\n")
    return answer.code


def _message(error: Exception) -> str:
    if isinstance(error, OSError) and error.strerror and error.filename:
        return f"{error.filename}: {error.strerror}"
    return str(error) or type(error).__name__
