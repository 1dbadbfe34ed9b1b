"""Runs with SLAM, or of a policy, under several kernels of the linear algebra library.

``python -m robustness.blas --count 12``

Run it in the folder ``tests``. OpenBLAS chooses its kernels by the processor, and each sums in an order of
its own; ``OPENBLAS_CORETYPE`` makes one machine do what others would.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

CORES = ("Prescott", "Nehalem", "Haswell")
FLOORS = ("apartment", "building:17", "clinic", "building:5")
OF_THE_MACHINE = ("decision_ms", "tick_ms", "peak_mb", "steps_per_s", "wall_s")


def result_of(floor, seed, core, folder, options):
    """Return what a run found, without what depends on the machine's speed."""
    arguments = [
        "run",
        "--floor",
        floor,
        "--seed",
        str(seed),
        "--horizon-s",
        "60",
        "--out",
        str(folder),
        "--json",
        *options,
    ]
    command = [sys.executable, "-c", "import sys; from lidarium.scripts.main import main; sys.exit(main())"]
    environment = {**os.environ, "OPENBLAS_CORETYPE": core}
    output = subprocess.run(
        [*command, *arguments], env=environment, check=True, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    )
    result = json.loads(output.stdout)
    pixels = (folder / "map.pgm").read_bytes()
    return json.dumps([{k: v for k, v in result.items() if k not in OF_THE_MACHINE}, pixels.hex()], sort_keys=True)


def main():
    """Run cases under each kernel and print how many differ."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=12)
    parser.add_argument("--policy", default="", help="one that runs with known poses, without SLAM; such as learned")
    chosen = parser.parse_args()
    count = chosen.count
    options = ("--realism", "ideal", "--policy", chosen.policy) if chosen.policy else ()
    differ = []
    for number in range(count):
        floor, seed = FLOORS[number % len(FLOORS)], number // len(FLOORS)
        with tempfile.TemporaryDirectory() as folder:
            found = [result_of(floor, seed, core, Path(folder) / core, options) for core in CORES]
        if len(set(found)) > 1:
            differ.append(f"{floor} seed {seed}")
    print(f"{len(differ)} of {count} runs differ between {', '.join(CORES)}: {'; '.join(differ) or '-'}")


if __name__ == "__main__":
    main()
