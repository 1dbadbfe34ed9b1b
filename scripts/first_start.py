"""The kernels that a first start compiles, in several processes."""

import json
import multiprocessing
import os
import signal
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

from lidarium.evaluation.processes import end_pool, interrupts_held
from lidarium.mapping.kernels.first_start import Entry, compile_kernel
from lidarium.scripts.common import counted, notify

LIST = Path(__file__).parent / "data" / "kernels_of_run.json"
"""The kernels that ``lidarium run`` calls from Python; ``scripts/dev/list_kernels.py`` writes it."""

MOST_PROCESSES = 4
"""The longest kernel takes a quarter of all the time: more processes gain little, and cost memory."""

POLL_S = 0.5


def compile_first(is_quiet: bool) -> None:
    """Compile the kernels of a run if most of them are not yet in the cache.

    Each process takes the next kernel of the list and keeps it in the cache, if this process finds it. A kernel
    that cannot be compiled so is left to its first call.
    """
    from lidarium.mapping.kernels.compilation import kernel_cache

    folder = kernel_cache()
    listed = json.loads(LIST.read_text())
    processes = min(len(os.sched_getaffinity(0)), MOST_PROCESSES)
    if folder is None or processes == 1 or 2 * count_compiled(folder) > listed["compiled"]:
        return
    notify(f"the first start compiles kernels in {processes} processes; later starts find them")
    for _ in counted(_compiled(folder, listed["kernels"], processes), listed["compiled"], "kernels compiled", is_quiet):
        pass


def count_compiled(folder: Path) -> int:
    """Return how many compiled kernels a cache folder holds."""
    return sum(1 for _ in folder.rglob("*.nbc"))


def _compiled(folder: Path, kernels: Sequence[Entry], processes: int) -> Iterator[int]:
    """Compile kernels side by side and yield a number for each that is new in the cache."""
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(processes, mp_context=context, initializer=_begin_process)
    count, is_whole = count_compiled(folder), False
    try:
        with interrupts_held():
            left: set[Future[None]] = {pool.submit(compile_kernel, each) for each in kernels}
        while left:
            left = wait(left, timeout=POLL_S).not_done
            before, count = count, count_compiled(folder)
            yield from range(before, count)
        is_whole = True
    except BrokenProcessPool:
        return  # missing kernels are compiled at their first call
    finally:
        end_pool(pool, are_ending=is_whole)


def _begin_process() -> None:
    """Leave Ctrl-C to the process that waits."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
