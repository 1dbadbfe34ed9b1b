"""Results of a report in the formats of others: marl-eval's JSON and a table in LaTeX."""

from collections.abc import Mapping, Sequence
from typing import Any

from lidarium.evaluation.analysis.episodes import pair_key_of
from lidarium.evaluation.analysis.figures import TIMES, TimeFigure, Value
from lidarium.evaluation.analysis.groups import Group, times_to
from lidarium.evaluation.report.tables import number
from lidarium.evaluation.statistics import Interval

ENVIRONMENT = "lidarium"

_LATEX = {character: rf"\{character}" for character in "&%$#_{}"} | {
    "\\": r"\textbackslash{}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
}


def marl_eval(groups: Sequence[Group], values: Sequence[Value]) -> dict[str, Any]:
    """Return episodes as marl-eval reads them: environment, task, algorithm, run, step, metric.

    A task is a group, a run is a seed, and a metric is a list of one number per floor and starts, in the order of their
    names; runs that not all policies have are left out.
    Times not reached are the horizon. Reference policies do not learn: their only step is 0.
    """
    tasks: dict[str, Any] = {}
    for group in groups:
        algorithms = tasks.setdefault(group.title, {})
        common = set.intersection(*({pair_key_of(row) for row in rows} for rows in group.runs.values()))
        for policy, rows in group.runs.items():
            runs = algorithms.setdefault(policy, {})
            shared = sorted((row for row in rows if pair_key_of(row) in common), key=pair_key_of)
            for seed in sorted({row["seed"] for row in shared}):
                of_seed = [row for row in shared if row["seed"] == seed]
                metrics: dict[str, list[float]] = {
                    key: times_to(of_seed, key, group.horizon_s).up_to_horizon.tolist() for key in TIMES
                }
                metrics |= {value.column.key: [value.of(row) for row in of_seed] for value in values}
                runs[f"seed_{seed}"] = {"step_0": {"step_count": 0, **metrics}, "absolute_metrics": metrics}
    return {ENVIRONMENT: tasks}


def latex_table(groups: Sequence[Group], figures: Sequence[Mapping[str, TimeFigure]]) -> str:
    """Return a table of times to 99 %, a line for each policy of each group, for the package booktabs."""
    lines = [
        r"\begin{tabular}{llrrr}",
        r"\toprule",
        r"floors & policy & runs & reached 99\,\% & time to 99\,\% [s], median (95\,\% interval) \\",
    ]
    for group, by_policy in zip(groups, figures, strict=True):
        lines.append(r"\midrule")
        for policy, figure in by_policy.items():
            share = rf"{100.0 * figure.success.estimate:.0f}\,\%"
            cells = [escaped(group.title), rf"\texttt{{{escaped(policy)}}}", str(figure.size), share]
            lines.append(" & ".join([*cells, _interval(figure.median, group.horizon_s)]) + r" \\")
    return "\n".join([*lines, r"\bottomrule", r"\end{tabular}"]) + "\n"


def escaped(text: str) -> str:
    """Return text without any meaning to LaTeX."""
    return "".join(_LATEX.get(character, character) for character in text)


def _interval(found: Interval, horizon_s: float) -> str:
    estimate, low, high = (
        number(end, horizon_s).replace(">", "$>$") for end in (found.estimate, found.low, found.high)
    )
    return f"{estimate} ({low} to {high})" if found.is_known else estimate
