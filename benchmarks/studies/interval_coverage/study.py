"""How often the intervals of `evaluation/statistics` hold a known truth."""

import platform
import time
from collections.abc import Mapping, Sequence
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np
import scipy

import lidarium
from lidarium.benchmarks.studies.interval_coverage.cases import Case, cases, held
from lidarium.benchmarks.studies.shared.kept import Progress, do_missing, kept_lines
from lidarium.benchmarks.studies.shared.study import Study
from lidarium.evaluation.statistics import FEWEST_FOR_NOMINAL

SIZES = (10, 20, 50, 100, 200)
WANTED = (0.93, 0.97)
TRIALS, RESAMPLES = 2000, 399
CASES_FILE = "cases.jsonl"

Line = Mapping[str, Any]


def measure(case: Case) -> dict[str, Any]:
    """Measure at all sizes how often the intervals of a case hold the truth."""
    began = time.perf_counter()
    shares = [held(case, size, TRIALS) for size in SIZES]
    return {
        "figure": case.figure,
        "data": case.data,
        "is_asked_for": case.is_asked_for,
        "trials": TRIALS,
        "resamples": RESAMPLES,
        "shares": shares,
        "seconds": time.perf_counter() - began,
    }


def work(folder: Path, _data: Path | None, every: int, _workers: int) -> Progress:
    """Measure every N-th case, in this process alone."""
    yield from do_missing(folder / CASES_FILE, "cases", list(cases(RESAMPLES))[::every], measure, 1)


def is_reached(shares: Sequence[tuple[float, int]]) -> bool:
    """Return whether a case is within `WANTED` at all sizes that count."""
    return all(
        WANTED[0] <= share <= WANTED[1]
        for size, (share, _) in zip(SIZES, shares, strict=True)
        if size >= FEWEST_FOR_NOMINAL
    )


def page(folder: Path, command: str) -> str:
    """Return the results as markdown."""
    lines = kept_lines(folder / CASES_FILE)
    trials, resamples, seconds = TRIALS, RESAMPLES, sum(line["seconds"] for line in lines)
    missed = [line for line in lines if line["is_asked_for"] and not is_reached(line["shares"])]
    asked = sum(line["is_asked_for"] for line in lines)
    text = [
        "# How often intervals hold the truth",
        "",
        f"`{command}` on {date.today().isoformat()}, lidarium {lidarium.__version__}, Python "
        f"{platform.python_version()}, numpy {np.__version__}, scipy {scipy.__version__}; {seconds:.0f} s on "
        "one core.",
        "",
        f"Share of {trials:,} trials in which the 95 % interval holds the known truth, in %, by the number "
        "of runs or pairs. Its standard "
        f"error is {100.0 * np.sqrt(0.95 * 0.05 / trials):.1f} at 95 %. Intervals are made of {resamples:,} "
        "resamples here, of 10,000 in "
        f"reports. Asked for are {100 * WANTED[0]:.0f} to {100 * WANTED[1]:.0f} at {FEWEST_FOR_NOMINAL} and "
        "more on normal, skewed and "
        "20 % censored data; the figures at 10 and 20 are published, not asked for, and reports warn there. "
        "Rows marked as beyond are "
        "harder than what is asked for, or discrete. What each interval is made of: "
        "[statistics](../reference/statistics.md).",
        "",
        "Times of two policies are drawn in pairs whose normal scores have a correlation of 0.5; the second "
        "policy takes 1.2 times "
        "as long. Cut by the horizon: runs end where the first policy has missed a fifth. Cut at random: "
        "exponential cuts come "
        "before a fifth of its times, and the horizon is its upper quartile.",
        "",
        f"**Reached in {asked - len(missed)} of {asked} rows that are asked for.**"
        + (
            ""
            if not missed
            else " Missed: " + "; ".join(f"{line['figure']}, {line['data']}" for line in missed) + "."
        ),
        *_tables(lines),
        "",
        "*refused*: trials in which the longest time was cut before the horizon, so that the mean up to "
        "there is unknown; the "
        "function says so, and the share is of the others.",
    ]
    return "\n".join(text) + "\n"


def _tables(lines: Sequence[Line]) -> list[str]:
    """Return a table for each figure, a row for each kind of data."""
    rows: list[str] = []
    figure = ""
    for line in lines:
        if line["figure"] != figure:
            figure = line["figure"]
            rows += ["", f"## {figure[0].upper()}{figure[1:]}", ""]
            rows += [
                f"| data | {' | '.join(f'n = {size}' for size in SIZES)} | 93 to 97 from n = 50 |",
                "|---|" + "---|" * (len(SIZES) + 1),
            ]
        verdict = ("yes" if is_reached(line["shares"]) else "**no**") + (
            "" if line["is_asked_for"] else " (beyond)"
        )
        cells = [
            f"{100.0 * share:.1f}{f' ({refused} refused)' if refused else ''}"
            for share, refused in line["shares"]
        ]
        rows.append(f"| {line['data']} | {' | '.join(cells)} | {verdict} |")
    return rows


STUDY = Study(page, work=work)
