"""Map merging on the half of the bank on which its limits are tuned.

Figures are quoted of the other half, by the study of merging itself.
"""

import platform
from collections import Counter
from collections.abc import Callable
from datetime import date
from functools import partial
from pathlib import Path

import lidarium
from lidarium.benchmarks.studies.merging import figures
from lidarium.benchmarks.studies.merging.bank.bank import read_maps, read_pairs
from lidarium.benchmarks.studies.merging.bank.floors import bank_floors
from lidarium.benchmarks.studies.merging.bank.making import make_bank
from lidarium.benchmarks.studies.merging.figures import Tried
from lidarium.benchmarks.studies.merging.trials import read_outcomes, try_pairs
from lidarium.benchmarks.studies.shared.study import Progress, Study
from lidarium.mapping.merging.settings import MODES

HALF = "tuning"
OUTCOMES_FOLDER = "outcomes"


def work(folder: Path, data: Path | None, every: int, workers: int) -> Progress:
    """Make the half of the bank, and try our own methods on its pairs.

    What is there is not done again.
    """
    floors = [floor for floor in bank_floors(data, every) if floor.half == HALF]
    yield from make_bank(folder, floors, workers)
    maps, pairs = read_maps(folder, floors), read_pairs(folder) or []
    for method in MODES:
        for done in try_pairs(folder / OUTCOMES_FOLDER, maps, pairs, method, workers):
            yield f"pairs, {method}", done, len(pairs)


def page(folder: Path, command: str) -> str:
    """Return the results as markdown."""
    pairs = read_pairs(folder) or []
    counts = Counter(pair.category for pair in pairs)
    tried: dict[str, Tried] = {
        method: list(zip(pairs, read_outcomes(folder / OUTCOMES_FOLDER, pairs, method), strict=True))
        for method in MODES
    }
    parts = [
        "# Merging maps: the half for tuning",
        f"Made by `{command}` on {date.today().isoformat()}: lidarium {lidarium.__version__}, Python "
        f"{platform.python_version()}. Limits "
        "are tuned on these pairs; figures are quoted of [the other half](merging.md), which also says how "
        "maps are made and what "
        "pairs are.",
        f"{len(pairs)} pairs: " + ", ".join(f"{count} {name}" for name, count in sorted(counts.items())) + ".",
        _table(tried),
        "Positives that are refused: "
        + "; ".join(f"`{method}` {_reasons(outcomes)}" for method, outcomes in tried.items())
        + ".",
    ]
    return "\n\n".join(parts) + "\n"


def _table(tried: dict[str, Tried]) -> str:
    """Return a table with a column for each method."""
    lines = [f"| | {' | '.join(f'`{method}`' for method in tried)} |", "|---|" + "---:|" * len(tried)]
    rows: dict[str, Callable[[Tried], object]] = {
        "recall, overlap 30 % and more": lambda one: figures.recall(one, figures.is_plenty),
        "recall, overlap 15 to 30 %": lambda one: figures.recall(one, figures.is_little),
        "false accepts": lambda one: figures.accepted(one, figures.NEGATIVE),
        **{f"{category}, refused": partial(_refused, category) for category in figures.UNDECIDABLE},
        "time without the fallback, median / 95 % [ms]": lambda one: figures.times(
            one, lambda outcome: not outcome.needed_fallback
        ),
        "time of all, median / 95 % [ms]": figures.times,
    }
    lines += [
        f"| {title} | {' | '.join(str(figure(outcomes)) for outcomes in tried.values())} |"
        for title, figure in rows.items()
    ]
    return "\n".join(lines)


def _refused(category: str, tried: Tried) -> figures.Share:
    return figures.refused(tried, (category,))


def _reasons(tried: Tried) -> str:
    """Return why positives were refused, the most frequent reason first."""
    reasons = Counter(
        one.reason.split(":")[0] for pair, one in tried if pair.category == "positive" and not one.is_accepted
    )
    return ", ".join(f"{count} {reason}" for reason, count in reasons.most_common()) or "none"


STUDY = Study(page, work=work)
