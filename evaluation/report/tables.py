"""Figures as markdown."""

import math
import re
from collections.abc import Iterable, Sequence

from lidarium.evaluation.analysis.figures import TIMES, Comparison, OverBound, TimeFigure, Value, ValueFigure, is_time
from lidarium.evaluation.analysis.groups import Group, times_to
from lidarium.evaluation.episodes.result import METRICS
from lidarium.evaluation.statistics import FEWEST_FOR_INTERVAL, Interval, median_interval
from lidarium.mapping.files.guarded_reading import printable

_SPECIAL = re.compile(r"([\\`*\[\]<>|$~])")
_WRITTEN = re.compile(r"`([^`]*)`|\\([\\`*\[\]<>|$~])|&amp;")


def plain(text: str) -> str:
    """Return text without any Markdown meaning, such as links and tables."""
    return _SPECIAL.sub(r"\\\1", printable(text).replace("&", "&amp;"))


def code(name: str) -> str:
    """Return a name as code; one that would end the code or a table's cell as plain text."""
    shown = printable(name)
    return f"`{shown}`" if shown.strip() and not set("`|") & set(shown) else plain(shown)


def as_text(markdown: str) -> str:
    """Return plain text of the output of `plain` and `code`, for pages that are not markdown."""
    return _WRITTEN.sub(lambda found: found[1] or found[2] or "&", markdown)


NONE = "–"  # noqa: RUF001


def markdown_table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table; the first column to the left, the others to the right."""
    lines = [header, ["---", *["---:"] * (len(header) - 1)], *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def number(value: float, horizon_s: float | None = None, digits: int = 1) -> str:
    """Return a number with that many digits behind the point.

    Inf as later than the horizon.
    """
    if math.isinf(value):
        return f"> {horizon_s:.0f}" if value > 0.0 and horizon_s is not None else NONE
    text = f"{value:.{digits}f}"
    return text.removeprefix("-") if float(text) == 0.0 else text


def interval(found: Interval | None, horizon_s: float | None = None, scale: float = 1.0, digits: int = 1) -> str:
    """Return an estimate with its interval in brackets.

    Unbounded ends of the interval are left open; without an interval there are no brackets.
    """
    if found is None:
        return NONE
    if not found.is_known:
        return number(scale * found.estimate, horizon_s, digits)
    estimate, low, high = (number(scale * end, horizon_s, digits) for end in (found.estimate, found.low, found.high))
    return f"{estimate} [{low}, {high}]"


def p_value(value: float) -> str:
    """Return a p value with as many digits as matter."""
    return "< 0.0001" if value < 1e-4 else f"{value:.2g}" if value < 0.01 else f"{value:.3f}"


def times_table(figures: dict[str, TimeFigure], horizon_s: float) -> str:
    """Return success, median and restricted mean of a time by policy."""
    header = ("policy", "runs", "reached", "success [%]", "median [s]", f"mean up to {horizon_s:.0f} s [s]")
    rows = [
        (
            code(policy),
            str(figure.size),
            str(figure.reached),
            interval(figure.success, scale=100.0),
            interval(figure.median, horizon_s),
            interval(figure.restricted_mean, horizon_s),
        )
        for policy, figure in figures.items()
    ]
    return markdown_table(header, rows)


def over_bound_table(figures: dict[str, OverBound | None]) -> str:
    """Return the times beside their bounds by policy."""
    rows = [
        (code(policy), interval(figure.ratio, digits=2), interval(figure.gap, scale=100.0))
        for policy, figure in figures.items()
        if figure is not None
    ]
    return markdown_table(
        ("policy", f"time to 99 % over the bound, median ({NONE} if not reached)", "optimality gap, mean [%]"), rows
    )


def values_table(figures: dict[str, dict[str, ValueFigure]], values: Sequence[Value]) -> str:
    """Return the median of every value by policy, or its mean if the column requires it."""
    columns = [value.column for value in values]
    header = [f"{_headed(each.title, each.unit)}, {'mean' if each.by_mean else 'median'}" for each in columns]
    rows = []
    for policy, by_key in figures.items():
        shown = [by_key[each.key].mean if each.by_mean else by_key[each.key].median for each in columns]
        cells = [interval(found, digits=each.digits) for found, each in zip(shown, columns, strict=True)]
        rows.append([code(policy), *cells])
    return markdown_table(["policy", *header], rows)


def _headed(title: str, unit: str) -> str:
    return f"{plain(title)} [{plain(unit)}]" if unit else plain(title)


def further_table(figures: dict[str, dict[str, Interval]], horizon_s: float) -> str:
    """Return the medians of all other figures, one a line, policies side by side."""
    policies = list(figures)
    keys = [key for key in figures[policies[0]] if all(key in by_key for by_key in figures.values())]
    rows = [
        [
            code(key),
            *(
                interval(figures[policy][key], horizon_s if is_time(key) else None, digits=_digits(key))
                for policy in policies
            ),
        ]
        for key in keys
    ]
    return markdown_table(["figure, median", *(code(policy) for policy in policies)], rows) if rows else ""


def _digits(key: str) -> int:
    if key in METRICS:
        return METRICS[key].digits
    return 1 if key.endswith(("_s", "_m", "_ms", "_percent")) else 3


def comparisons_table(comparisons: Sequence[Comparison], values: Sequence[Value]) -> str:
    """Return differences, ratios and tests of policies against the baseline."""
    titles = {key: _headed(title, "s") for key, title in TIMES.items()} | {
        value.column.key: _headed(value.column.title, value.column.unit) for value in values
    }
    header = (
        "policy",
        "figure",
        "pairs",
        "difference",
        "ratio",
        "P(better)",
        "less / more / same",
        "Wilcoxon p",
        "p of Holm",
        "sign p",
    )
    rows = [
        (
            code(each.policy),
            titles[each.key],
            str(each.pairs),
            _difference(each),
            interval(each.ratio, digits=2),
            interval(each.improvement, digits=2),
            f"{each.wilcoxon.less} / {each.wilcoxon.greater} / {each.wilcoxon.ties}",
            p_value(each.wilcoxon.p_value),
            p_value(each.p_holm),
            p_value(each.sign.p_value),
        )
        for each in comparisons
    ]
    return markdown_table(header, rows)


def _difference(comparison: Comparison) -> str:
    """Return the difference, marked by what tests say; with the pairs if they are too few for an interval."""
    text = interval(comparison.difference)
    if comparison.pairs < FEWEST_FOR_INTERVAL:
        return f"{text} ({', '.join(f'{number(a)} / {number(b)}' for a, b in comparison.values)})"
    return f"**{text}**" if comparison.is_beyond_chance else f"{text} †" if comparison.p_holm < 0.05 else text


def floors_table(group: Group, key: str) -> str:
    """Return the median time of each policy on each floor.

    The number of its runs that reached the share is given as well.
    """
    rows = []
    for floor in group.floors:
        cells = []
        for rows_of_policy in group.on_floor(floor).values():
            if not rows_of_policy:
                cells.append(NONE)
                continue
            found = times_to(rows_of_policy, key, group.horizon_s)
            cells.append(
                f"{number(median_interval(found.or_never).estimate, group.horizon_s)} "
                f"({found.is_reached.sum()}/{len(found.times)})"
            )
        rows.append([plain(floor), *cells])
    return markdown_table(["floor", *(code(policy) for policy in group.runs)], rows)
