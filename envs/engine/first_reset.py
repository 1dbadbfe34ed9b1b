"""The kernels of a first reset, compiled side by side if the cache has none."""

import json
import multiprocessing
import os
import sys
from collections.abc import Iterable
from itertools import islice
from pathlib import Path

from lidarium.mapping.kernels.compilation import IS_INTERPRETED, kernel_cache
from lidarium.mapping.kernels.first_start import SWITCH, compile_in_processes

LIST = Path(__file__).parent / "data" / "kernels_of_reset.json"
"""The kernels of a first reset that take long; ``scripts/dev/list_reset_kernels.py`` writes it."""

MOST_PROCESSES = 4
LOCK = "first_start.lock"
"""File in the cache that marks that another process is compiling."""

_asked = False


def compile_first_reset() -> None:
    """Compile the kernels of a reset in several processes, if almost none are compiled yet.

    This is checked once per process, and skipped in child processes, on one core, and if ``LIDARIUM_FIRST_START`` is
    ``off``.
    """
    global _asked  # once in a process
    if _asked:
        return
    _asked = True
    processes = min(_cores(), MOST_PROCESSES)
    if IS_INTERPRETED or processes < 2 or os.environ.get(SWITCH) == "off" or not sys.executable:
        return
    folder = kernel_cache()
    if folder is None or multiprocessing.parent_process() is not None:
        return
    entries = json.loads(LIST.read_text())
    if sum(1 for _ in islice(folder.rglob("*.nbc"), len(entries))) == len(entries):
        return
    try:
        lock = os.open(folder / LOCK, os.O_CREAT | os.O_EXCL | os.O_WRONLY)
    except OSError:
        return
    os.close(lock)
    try:
        for _ in _shown(compile_in_processes(entries, processes), len(entries), processes):
            pass
    finally:
        (folder / LOCK).unlink(missing_ok=True)


def _cores() -> int:
    """Return how many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else int(os.cpu_count() or 1)


def _shown(names: Iterable[str], total: int, processes: int) -> Iterable[str]:
    """Pass names on, and show their number on standard error: a bar on a terminal, otherwise a line."""
    about = f"lidarium: the first reset compiles kernels in {processes} processes; later ones find them"
    print(about, file=sys.stderr, flush=True)
    if not sys.stderr.isatty():
        return names
    from tqdm import tqdm

    shown: Iterable[str] = tqdm(names, total=total, unit="kernel", leave=False)
    return shown
