"""The figures of a method on one half of a bank.

They are recall, false accepts, refusals, errors and times.

Limits are tuned with ``--half tuning``; figures are quoted of the other half (docs/results/merging.md).
"""

import argparse
import sys
from collections import Counter
from pathlib import Path

from lidarium.benchmarks.studies.merging import figures
from lidarium.benchmarks.studies.merging.bank.bank import read_maps, read_pairs
from lidarium.benchmarks.studies.merging.bank.floors import HALVES, bank_floors
from lidarium.benchmarks.studies.merging.trials import METHODS, read_outcomes, try_pairs


def main() -> None:
    """Try what is missing, and print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("bank", type=Path, help="folder of the bank")
    parser.add_argument("--data", type=Path, help="folder of real floors with which the bank was made")
    parser.add_argument(
        "--every", type=int, default=1, help="the share of floors with which the bank was made"
    )
    parser.add_argument("--half", choices=HALVES, default="tuning", help="which pairs")
    parser.add_argument("--method", choices=METHODS, default="default", help="who merges")
    parser.add_argument(
        "--out", type=Path, help="folder of the outcomes; below the bank's where it is not given"
    )
    parser.add_argument("--workers", type=int, default=1, help="processes")
    arguments = parser.parse_args()
    maps = read_maps(arguments.bank, bank_floors(arguments.data, arguments.every))
    pairs = [pair for pair in read_pairs(arguments.bank) or [] if pair.half == arguments.half]
    folder = arguments.out or arguments.bank / f"outcomes-{arguments.half}"
    for done in try_pairs(folder, maps, pairs, arguments.method, arguments.workers):
        print(f"{done} of {len(pairs)}", file=sys.stderr)
    tried = list(zip(pairs, read_outcomes(folder, pairs, arguments.method), strict=True))
    print(f"recall, overlap 30 % and more: {figures.recall(tried, figures.is_plenty)}")
    print(f"recall, overlap 15 to 30 %:    {figures.recall(tried, figures.is_little)}")
    print(f"false accepts:                 {figures.accepted(tried, figures.NEGATIVE)}")
    for category in figures.UNDECIDABLE:
        print(f"{category} refused: {figures.refused(tried, (category,))}")
    print(f"time, without the fallback: {figures.times(tried, lambda one: not one.needed_fallback)} ms")
    print(f"time, all: {figures.times(tried)} ms")
    reasons = Counter(
        one.reason.split(":")[0] for pair, one in tried if pair.category == "positive" and not one.is_accepted
    )
    print("positives refused: " + ", ".join(f"{count} {reason}" for reason, count in reasons.most_common()))


if __name__ == "__main__":
    main()
