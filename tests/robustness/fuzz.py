"""Damaged files and extreme settings by the thousand.

``python -m robustness.fuzz files --count 100000``

Run it in the folder ``tests``. Every case is drawn from the seed and its number alone, so that one can be
repeated: ``--first N --count 1``. A case counts as wrong where anything but a clear error of the package
comes out, where its process dies of a signal, or where it computes
for more than five seconds.
"""

import argparse
import collections
import json
import os
import queue
import subprocess
import sys
import tempfile
import threading
import time
from dataclasses import dataclass, field
from pathlib import Path

from robustness.samples import make_samples

HANGS_S = 5.0
MOST_S, MOST_MB = 1.0, 512.0
"""What reading a file may take: time of the processor, and memory beyond what its process held."""

WAITS = 6
"""A case that waits for something else than its turn to compute is given so many times as long."""

STARTS_S = 180.0
"""A worker's first case may have to wait for kernels."""

TESTS = Path(__file__).resolve().parents[1]


@dataclass
class Tally:
    """How the cases ended.

    Attributes
    ----------
    kinds : counter of str
        Cases by how they ended: fine, refused, wrong, signal, hang.
    faults : list of (int, str)
        Number and reason of each that is wrong.
    costly : list of (int, float, float)
        Number, CPU time [s] and memory [MB] of each that took more than a file may.
    slowest, largest : (float, int), (float, int)
        Longest CPU time [s] and most memory [MB] of a case, and its number.
    """

    kinds: collections.Counter[str] = field(default_factory=collections.Counter)
    faults: list[tuple[int, str]] = field(default_factory=list)
    costly: list[tuple[int, float, float]] = field(default_factory=list)
    slowest: tuple[float, int] = (0.0, -1)
    largest: tuple[float, int] = (0.0, -1)

    def add(self, number: int, found: dict[str, object]) -> None:
        """Count a case."""
        self.kinds[str(found["kind"])] += 1
        if found["kind"] not in ("fine", "refused"):
            self.faults.append((number, f"{found['kind']} {found.get('error', '')} {found.get('at', '')}"))
        took_s, took_mb = (float(str(found.get(name, 0.0))) for name in ("cpu_s", "mb"))
        self.slowest, self.largest = max(self.slowest, (took_s, number)), max(self.largest, (took_mb, number))
        if took_s > MOST_S or took_mb > MOST_MB:
            self.costly.append((number, took_s, took_mb))


def run_cases(kind: str, samples: Path, seed: int, first: int, count: int, tally: Tally) -> None:
    """Run cases in worker processes, one after the other, and count how they end."""
    last = first + count
    while first < last:
        first = _run_worker(kind, samples, seed, first, last, tally)


def _run_worker(kind: str, samples: Path, seed: int, first: int, last: int, tally: Tally) -> int:
    """Run cases in a worker until it is done, dies or hangs; return the first case that is left."""
    command = [
        sys.executable,
        "-m",
        "robustness.worker",
        kind,
        str(samples),
        str(seed),
        str(first),
        str(last),
    ]
    environment = {**os.environ, "LIDARIUM_FLOOR_STORE": "off", "NUMBA_NUM_THREADS": "1"}
    worker = subprocess.Popen(
        command, cwd=TESTS, env=environment, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    )
    lines: queue.SimpleQueue[str | None] = queue.SimpleQueue()
    passing = threading.Thread(target=_pass_on, args=(worker, lines), daemon=True)
    passing.start()
    current, patience, began_s, waited = None, STARTS_S, 0.0, 0
    try:
        while True:
            try:
                line = lines.get(timeout=patience)
            except queue.Empty:
                computed_s, is_running = _cpu_s(worker.pid)
                waited += not is_running
                if waited < WAITS and computed_s - began_s < HANGS_S:
                    continue
                tally.add(first if current is None else current, {"kind": "hang"})
                return (first if current is None else current) + 1
            if line is None:
                break
            word, *rest = line.split(" ", 2)
            if word == "begin":
                # The first case imports and loads what the others find.
                current = int(rest[0])
                patience = STARTS_S if current == first else HANGS_S
                (began_s, _), waited = _cpu_s(worker.pid), 0
            elif word == "compiling":
                patience = STARTS_S
            elif word == "compiled":  # compiling is not part of the case
                patience, (began_s, _), waited = HANGS_S, _cpu_s(worker.pid), 0
            elif word == "end":
                tally.add(int(rest[0]), json.loads(rest[1]))
                current = None
        if worker.wait() == 0:
            return last
        died = first if current is None else current
        tally.add(died, {"kind": "signal", "error": str(worker.returncode)})
        return died + 1
    finally:
        worker.kill()
        worker.wait()
        passing.join()
        if worker.stdout is not None:
            worker.stdout.close()


def _cpu_s(process: int) -> tuple[float, bool]:
    """Return how long a process has computed [s], and whether it computes or waits for its turn to."""
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK"), fields[0] == "R"


def _pass_on(worker: "subprocess.Popen[str]", lines: "queue.SimpleQueue[str | None]") -> None:
    for line in worker.stdout or ():
        lines.put(line.rstrip("\n"))
    lines.put(None)


def fuzz(kind: str, count: int, seed: int = 0, first: int = 0, samples: Path | None = None) -> Tally:
    """Run so many cases of a kind, ``files`` or ``settings``; return how they ended."""
    tally = Tally()
    with tempfile.TemporaryDirectory() as folder:
        if samples is None:
            samples = Path(folder) / "samples"
            samples.mkdir()
            if kind == "files":
                make_samples(samples)
        run_cases(kind, samples, seed, first, count, tally)
    return tally


def main() -> int:
    """Run the cases that the command line asks for, and print what came of them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("kind", choices=("files", "settings"))
    parser.add_argument("--count", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--samples", type=Path, default=None, help="folder of valid files, else made anew")
    asked = parser.parse_args()
    began = time.monotonic()
    tally = fuzz(asked.kind, asked.count, asked.seed, asked.first, asked.samples)
    for number, fault in tally.faults[:200]:
        print(f"case {number}: {fault}")
    for number, took_s, took_mb in tally.costly[:200]:
        print(f"case {number}: {took_s:.2f} s of CPU, {took_mb:.0f} MB")
    (slowest_s, slowest), (largest_mb, largest) = tally.slowest, tally.largest
    print(
        f"{sum(tally.kinds.values())} cases in {time.monotonic() - began:.0f} s: {dict(tally.kinds)}; "
        f"{len(tally.costly)} above {MOST_S:g} s or {MOST_MB:g} MB, slowest {slowest_s:.2f} s of CPU "
        f"(case {slowest}), largest {largest_mb:.0f} MB (case {largest})"
    )
    return 1 if tally.faults else 0


if __name__ == "__main__":
    sys.exit(main())
