"""The bank of partial maps: made by driving robots, into a folder.

What is there is not made again.

``lidarium reproduce merging`` makes the same bank and tries everything on it; this makes the bank alone.
"""

import argparse
import sys
from collections import Counter
from pathlib import Path

from lidarium.benchmarks.studies.merging.bank.bank import (
    drives_of,
    fill,
    missing_drives,
    read_maps,
    read_pairs,
    write_pairs,
)
from lidarium.benchmarks.studies.merging.bank.floors import bank_floors
from lidarium.benchmarks.studies.merging.bank.pairs import choose_pairs


def main() -> None:
    """Make the bank, and print how many pairs of each kind there are."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("runs/merging"), help="folder of the bank")
    parser.add_argument(
        "--data", type=Path, help="folder of real floors; without it generated and drawn floors alone"
    )
    parser.add_argument("--every", type=int, default=1, help="of each kind of floor every so many-th")
    parser.add_argument("--workers", type=int, default=1, help="processes that drive")
    arguments = parser.parse_args()
    floors = bank_floors(arguments.data, arguments.every)
    total = len(drives_of(floors))
    first = total - len(missing_drives(arguments.out, floors)) + 1
    for done, (drive, error) in enumerate(fill(arguments.out, floors, arguments.workers), first):
        print(f"{done} of {total} {drive.name}{'' if error is None else f': {error}'}", file=sys.stderr)
    pairs = read_pairs(arguments.out)
    if pairs is None:
        pairs = list(choose_pairs(read_maps(arguments.out, floors)))
        write_pairs(arguments.out, pairs)
    for (half, category), count in sorted(Counter((pair.half, pair.category) for pair in pairs).items()):
        print(f"{half:7} {category:11} {count}")


if __name__ == "__main__":
    main()
