"""Compiles listed kernels in several processes at a first start, each after those that it calls.

Lists name kernels by module and the types of their arguments. This module also runs as a process that
compiles: it reads one kernel per line, and answers each with a line.
"""

import contextlib
import importlib
import json
import multiprocessing
import os
import subprocess
import sys
import threading
import time
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from queue import SimpleQueue
from typing import Any

from lidarium.mapping.kernels.compilation import IS_INTERPRETED, kernel_cache

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

MOST_PROCESSES = 4
"""More would gain little, as kernels wait for those that they call, and cost memory."""

LOCK = "first_start.lock"
"""File in the cache that is locked by the process that fills it."""

LINE_PERIOD_S = 5.0
"""Interval between progress lines when standard error is not a terminal [s]."""

SWITCH = "LIDARIUM_FIRST_START"
"""Environment variable: ``off`` compiles each kernel at its first call."""

Entry = dict[str, Any]
"""A kernel: ``name`` as ``module:name``, and ``signature``, a list of encoded types."""


# -- First start -------------------------------------------------------------------------------------------


def compile_listed(path: Path, start: str) -> None:
    """Compile the kernels of a list in several processes if most of them are not in the cache.

    ``start`` names it in the message. Nothing is done in child processes, on one core, while another process
    does it, and if ``LIDARIUM_FIRST_START`` is ``off``: then each kernel is compiled at its first call.
    """
    processes = min(_cores(), MOST_PROCESSES)
    if IS_INTERPRETED or processes < 2 or os.environ.get(SWITCH) == "off" or not sys.executable:
        return
    folder = kernel_cache()
    if folder is None or multiprocessing.parent_process() is not None:
        return
    entries: list[Entry] = json.loads(path.read_text())
    # A compiled function is in "module.function-line.version.nbi".
    cached = {file.name.rpartition("-")[0] for file in folder.rglob("*.nbi")}
    if 2 * sum(each["name"].rpartition(".")[2].replace(":", ".") in cached for each in entries) > len(entries):
        return
    with _locked(folder) as is_alone:
        if is_alone:
            _tell(f"{start} compiles kernels in {processes} processes; later ones find them")
            for _ in _shown(compile_in_processes(entries, processes), len(entries)):
                pass


def _cores() -> int:
    """Return how many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else int(os.cpu_count() or 1)


@contextlib.contextmanager
def _locked(folder: Path) -> Iterator[bool]:
    """Hold the lock of a cache; yield whether this process got it. The system gives it back at the process's end."""
    with contextlib.ExitStack() as stack:
        try:
            folder.mkdir(parents=True, exist_ok=True)
            file = stack.enter_context((folder / LOCK).open("a"))
            if fcntl is not None:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            is_alone = True
        except OSError:  # another process holds it, or nothing can be written here
            is_alone = False
        yield is_alone


def _shown(names: Iterable[str], total: int) -> Iterator[str]:
    """Pass names on, and show their number on standard error: a bar on a terminal, otherwise lines."""
    if sys.stderr.isatty():
        from tqdm import tqdm

        yield from tqdm(names, total=total, unit="kernel", leave=False)
        return
    last = time.monotonic()
    for count, name in enumerate(names, 1):
        yield name
        if time.monotonic() - last >= LINE_PERIOD_S:
            last = time.monotonic()
            _tell(f"{count} of {total} kernels compiled")


def _tell(message: str) -> None:
    with contextlib.suppress(OSError, ValueError):  # standard error is closed
        print(f"lidarium: {message}", file=sys.stderr, flush=True)


# -- Kernels of lists --------------------------------------------------------------------------------------


def compile_kernel(entry: Entry) -> None:
    """Compile a kernel for the types of its arguments, and cache it.

    Raises ValueError, AttributeError or ImportError if there is no such kernel or type.
    """
    module, name = entry["name"].split(":")
    compiled = getattr(importlib.import_module(module), name)
    compiled.compile(tuple(decode_type(each) for each in entry["signature"]))


def _numba_types() -> Any:  # noqa: ANN401
    """Return numba's module of types, which has no hints."""
    from numba.core import types

    return types


def encode_type(argument: Any) -> Any:  # noqa: ANN401
    """Return the numba type of an argument as strings, lists and dicts.

    Scalars are their names; arrays ``dtype:dimensions+layout``, with ``:readonly`` if they are; tuples lists; named
    tuples ``{"class": "module:name", "of": list}``. Raises ValueError for other types.
    """
    types = _numba_types()
    if isinstance(argument, types.Array):
        return f"{argument.dtype}:{argument.ndim}{argument.layout}" + ("" if argument.mutable else ":readonly")
    if isinstance(argument, types.BaseNamedTuple):
        made = argument.instance_class
        return {
            "class": f"{made.__module__}:{made.__qualname__}",
            "of": [encode_type(each) for each in argument.types],
        }
    if isinstance(argument, types.BaseTuple):
        return [encode_type(each) for each in argument.types]
    if isinstance(argument, types.Literal):  # a constant of the caller
        return {"literal": argument.literal_value}
    if isinstance(argument, types.Number | types.Boolean):
        return str(argument)
    raise ValueError(f"the type {argument!r} of a kernel's argument cannot be written; want numbers or arrays")


def decode_type(text: Any) -> Any:  # noqa: ANN401
    """Return the type that ``encode_type`` wrote."""
    types = _numba_types()
    if isinstance(text, dict) and "literal" in text:
        return types.literal(text["literal"])
    if isinstance(text, dict):
        module, name = text["class"].split(":")
        made = getattr(importlib.import_module(module), name)
        return types.BaseTuple.from_types([decode_type(each) for each in text["of"]], made)
    if isinstance(text, list):
        return types.BaseTuple.from_types([decode_type(each) for each in text])
    dtype, *shape = text.split(":")
    scalar = {"bool": types.boolean}.get(dtype) or getattr(types, dtype)
    if not shape:
        return scalar
    return types.Array(scalar, int(shape[0][:-1]), shape[0][-1], readonly=shape[1:] == ["readonly"])


# -- Processes ---------------------------------------------------------------------------------------------


def compile_in_processes(entries: Sequence[Entry], processes: int) -> Iterator[str]:
    """Compile kernels in a number of processes; yield each one's name as it is done.

    Entries have ``needs`` as well, the indices of the entries that they call. The longest come first.
    """
    plan, names = _Plan(entries), SimpleQueue[str | None]()
    workers = [_start_worker() for _ in range(min(processes, len(entries)))]
    threads = [threading.Thread(target=_drive, args=(worker, plan, entries, names), daemon=True) for worker in workers]
    for thread in threads:
        thread.start()
    try:
        ended = 0
        while ended < len(threads):
            name = names.get()
            if name is None:
                ended += 1
            else:
                yield name
    finally:
        plan.stop()
        for worker in workers:
            worker.kill()
            worker.wait()


class _Plan:
    """The listed kernels that are left; shared by the threads that wait for processes."""

    def __init__(self, entries: Sequence[Entry]) -> None:
        self._entries = entries
        self._left = list(range(len(entries)))
        self._done: set[int] = set()
        self._changed = threading.Condition()
        self._is_stopped = False

    def take(self) -> int | None:
        """Return the first kernel whose callees are compiled, once there is one; None if all are taken."""
        with self._changed:
            while self._left and not self._is_stopped:
                for number in self._left:
                    if self._done.issuperset(self._entries[number]["needs"]):
                        self._left.remove(number)
                        return number
                self._changed.wait()
            return None

    def finish(self, number: int) -> None:
        """Note that a kernel was compiled, or could not be."""
        with self._changed:
            self._done.add(number)
            self._changed.notify_all()

    def stop(self) -> None:
        """Give out no more kernels."""
        with self._changed:
            self._is_stopped = True
            self._changed.notify_all()


def _start_worker() -> "subprocess.Popen[str]":
    return subprocess.Popen(
        [sys.executable, "-m", "lidarium.mapping.kernels.first_start"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env={**os.environ, SWITCH: "off"},
        text=True,
    )


def _drive(
    worker: "subprocess.Popen[str]", plan: _Plan, entries: Sequence[Entry], names: "SimpleQueue[str | None]"
) -> None:
    """Give a process one kernel after the other, until it ends or no kernel is left."""
    assert worker.stdin is not None
    assert worker.stdout is not None
    is_answered = True
    while is_answered and (number := plan.take()) is not None:
        try:
            worker.stdin.write(json.dumps(entries[number]) + "\n")
            worker.stdin.flush()
            is_answered = worker.stdout.readline() != ""
        except (OSError, ValueError):  # the process has ended
            is_answered = False
        plan.finish(number)
        if is_answered:
            names.put(entries[number]["name"])
    with contextlib.suppress(OSError):  # what the process has not read is written once more
        worker.stdin.close()
    worker.stdout.close()
    names.put(None)


def main() -> None:
    """Compile the kernels named on standard input; those that fail are left to their first call."""
    for line in sys.stdin:
        try:
            compile_kernel(json.loads(line))
            answer = "compiled"
        except Exception as error:
            answer = f"left out: {type(error).__name__}"
        print(answer, flush=True)


if __name__ == "__main__":
    main()
