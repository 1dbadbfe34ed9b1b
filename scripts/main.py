"""The command line: parses arguments, runs commands, and converts the outcome into exit codes."""

import inspect
import os
import sys
import traceback
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import fields, is_dataclass, replace
from typing import Any, TextIO, get_args, get_origin, get_type_hints

import lidarium
from lidarium.registry import import_own
from lidarium.scripts.commands import COMMANDS, find_installed
from lidarium.scripts.common import (
    BAD_INPUT,
    DEFECT,
    DONE,
    INTERRUPTED,
    TERMINATED,
    Answer,
    Command,
    announce_compiling,
    notify,
    table,
)
from lidarium.scripts.options import gathered

_IN_TWO_WORDS = {
    ("sparse-map", "edit"): "sparse-map-edit",
    ("examples", "copy"): "examples-copy",
    ("ros", "serve"): "ros-serve",
    ("ros", "drive"): "ros-drive",
    ("ros", "play"): "ros-play",
}
"""Commands in two words; the first of some is a command of its own that takes files."""

_OVERVIEW = """usage: lidarium [--version] [--import MODULE] COMMAND [OPTIONS]

Teams of lidar robots explore unknown floors. Begin with `lidarium run`.

commands; `lidarium COMMAND --help` shows the options of one:
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command and return its exit code.

    0 is done, 2 bad input, 3 no solution found, 4 done but probably wrong, 130 interrupted by Ctrl-C, 143 by SIGTERM
    (finished parts are kept), 1 a defect of lidarium. The arguments are those of the process by default.
    """
    from lidarium.evaluation.processes import CLEANUP_IS_UNSAFE, end_workers, heard_termination, leave_at_the_next

    is_process = arguments is None
    if is_process:
        _open_closed_streams()
    with heard_termination() as termination:
        try:
            code = _ended(arguments)
        except KeyboardInterrupt:
            code = INTERRUPTED
            notify("interrupted")
        if code == INTERRUPTED:
            code = TERMINATED if termination.is_asked else INTERRUPTED
            if is_process:
                leave_at_the_next(code)
            end_workers()
    if is_process:
        _flush_streams()
        if CLEANUP_IS_UNSAFE.is_set():
            os._exit(code)
    return code


def _ended(arguments: Sequence[str] | None) -> int:
    """Run a command; return its exit code, errors included."""
    if list(sys.argv[1:] if arguments is None else arguments) == ["--version"]:
        _print_result(f"lidarium {lidarium.__version__}\n")
        return DONE
    try:
        return _answered(list(sys.argv[1:] if arguments is None else arguments))
    except SystemExit as leaving:  # tyro, after it printed help (0) or an error in the options (2)
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
        from lidarium.mapping.kernels.interrupts import is_wrapped_interrupt

        if is_wrapped_interrupt(error):
            raise KeyboardInterrupt from error
        notify(
            "lidarium: this is a defect of lidarium, not of your input. Please report it with the command "
            "line and the lines below.\n"
        )
        notify(traceback.format_exc())
        return DEFECT


def _answered(words: list[str]) -> int:
    """Run the command that the words of a command line ask for; print its result and return its exit code."""
    import_own(_imports(words))
    if not words or words[0] in ("-h", "--help"):
        find_installed()
        text = _OVERVIEW + table(COMMANDS.summaries.items()) + "\n"
        if not words:
            notify(text.rstrip())
            return BAD_INPUT
        _print_result(text)
        return DONE
    if tuple(words[:2]) in _IN_TWO_WORDS:
        words[:2] = [_IN_TWO_WORDS[words[0], words[1]]]
    if words[0] not in COMMANDS:
        find_installed()
    execute = COMMANDS[words[0]]
    command = _options(execute, words[0], words[1:])
    if isinstance(command, Command) and not command.writes:
        command.refuse("the command writes no files", "out")
    if command.compiles:
        announce_compiling()
    answer = execute(command)
    if answer.result:
        from lidarium.mapping.files.output import as_json

        _print_result(as_json(answer.result) if command.json else answer.text + "\n")
    return answer.code


def _imports(words: list[str]) -> list[str]:
    """Take ``--import MODULE`` out of a command line; return the modules."""
    found = []
    for place in reversed([k for k, word in enumerate(words) if word.partition("=")[0] == "--import"]):
        _, equals, module = words.pop(place).partition("=")
        if not equals:
            module = words.pop(place) if place < len(words) else ""
        if not module or module.startswith("-"):
            raise ValueError("--import has no module; want --import MODULE, such as --import my_metrics")
        found.append(module)
    return found[::-1]


def _lists(options: Any) -> set[str]:  # noqa: ANN401
    """Return the options that take several values, with those of the commands below."""
    hints = get_type_hints(options, include_extras=True)
    found = {f"--{key.replace('_', '-')}" for key, hint in hints.items() if get_origin(hint) is tuple}
    below = [get_args(member)[0] for hint in hints.values() for member in get_args(hint) if get_origin(member)]
    return found.union(*(_lists(each) for each in below if is_dataclass(each)))


def _options(execute: Callable[[Any], Answer], name: str, words: list[str]) -> Command:
    """Return the options of a command, read from the words behind its name."""
    import tyro

    config = (tyro.conf.OmitArgPrefixes, tyro.conf.OmitSubcommandPrefixes, tyro.conf.FlagCreatePairsOff)
    parameter = next(iter(inspect.signature(execute).parameters))
    options: type[Command] = get_type_hints(execute)[parameter]
    words = gathered(words, _lists(options))
    try:
        command = tyro.cli(options, prog=f"lidarium {name}", args=words, config=config)
    except BrokenPipeError as error:  # the reader of the help has ended
        _silence(sys.stdout)
        raise SystemExit(DONE) from error
    names = {word.partition("=")[0].removeprefix("--").replace("-", "_") for word in words if word.startswith("--")}
    if not isinstance(command, Command):  # one that has others below it
        return command
    given = (each.name for each in fields(command) if not names.isdisjoint({each.name, f"no_{each.name}"}))
    return replace(command, given=frozenset(given))


def _message(error: Exception) -> str:
    from lidarium.mapping.files.guarded_reading import shortened

    if isinstance(error, OSError) and error.strerror and error.filename:
        return f"{error.filename}: {error.strerror}"
    return shortened(str(error)) or type(error).__name__


def _open_closed_streams() -> None:
    """Give this process the standard streams that it was started without.

    They lead to nowhere. Otherwise a file opened later would take their numbers, and all output would be
    written into it.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest number that is free
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115


def _silence(stream: TextIO) -> None:
    """Lead a stream to nowhere.

    Its reader has left, and Python would complain at exit.
    """
    with suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)


def _print_result(text: str) -> None:
    """Print a result on standard output."""
    try:
        sys.stdout.write(text)
        sys.stdout.flush()
    except BrokenPipeError:
        _silence(sys.stdout)
    except OSError as error:
        _silence(sys.stdout)
        message = f"the result cannot be written: {error.strerror}"
        raise OSError(error.errno, message, "standard output") from error


def _flush_streams() -> None:
    """Write the rest of the buffers, as at exit, but without complaints."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except (OSError, ValueError):
            _silence(stream)
