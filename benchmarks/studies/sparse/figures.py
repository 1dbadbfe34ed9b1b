"""Figures that the study is to reach, of all places together."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from lidarium.benchmarks.studies.sparse.paths import COLLIDES, LENGTH, SECONDS, TURNING
from lidarium.benchmarks.studies.sparse.tables import answered, answers_of
from lidarium.evaluation.report.tables import markdown_table

Line = Mapping[str, Any]


def figure_table(lines: Sequence[Line]) -> str:
    """Return what was to be reached, and what was."""
    header = ("figure", "to reach", "incremental", "full", "reached")
    rows = [
        _row("requests answered, least of a place [%]", (99.0, 100.0), _each(lines, _least_answered), True, 1),
        _row("paths that collide, of all places", (0, 0), _each(lines, _collisions), False, 0),
        _row("length over the optimum, mean", (1.03, 1.03), _each(lines, _over_optimum), False, 3),
        _row("turning over that of the grid, mean", (0.45, 0.45), _each(lines, _turning), False, 2),
        _row("plan, median [ms]", (0.1, 0.1), _each(lines, _median_time), False, 3),
        _row("plan, 95 % [ms]", (0.4, 0.4), _each(lines, _late_time), False, 3),
        _row("boxes of a map, most", (1500, None), _each(lines, _most_boxes), False, 0),
        _row("bytes of .bt over its bytes, least", (10.0, 10.0), _each(lines, _bits), True, 1),
        _row("the same, .bt deflated, least", (2.0, 2.0), _each(lines, _deflated), True, 2),
        _row("bytes of 16 a code over its bytes, least", (3.0, 3.0), _each(lines, _thesis_bytes), True, 1),
        _row("table tops and seats respected, least [%]", (100.0, 100.0), _each(lines, _tops), True, 2),
    ]
    return markdown_table(header, rows)


def _row(
    name: str, limits: tuple[float | None, float | None], values: tuple[float, float], is_least: bool, digits: int
) -> list[str]:
    are_reached = [
        limit is None or (value >= limit if is_least else value <= limit)
        for limit, value in zip(limits, values, strict=True)
    ]
    wanted = [f"{limit:g}" for limit in limits if limit is not None]
    sign = ">=" if is_least else "<="
    said = f"{sign} {wanted[0]}" if len(set(wanted)) == 1 else f"{sign} {wanted[0]}; {wanted[1]}"
    answer = "yes" if all(are_reached) else ", ".join("yes" if each else "no" for each in are_reached)
    return [name, said, *(f"{value:.{digits}f}" for value in values), answer]


def _each(lines: Sequence[Line], measure: Any) -> tuple[float, float]:  # noqa: ANN401
    return measure(lines, "incremental"), measure(lines, "full")


def _least_answered(lines: Sequence[Line], usage: str) -> float:
    return min(100.0 * float(answered(line, usage).mean()) for line in lines)


def _collisions(lines: Sequence[Line], usage: str) -> float:
    return float(sum(np.nansum(answers_of(line, usage)[:, COLLIDES]) for line in lines))


def _over_optimum(lines: Sequence[Line], usage: str) -> float:
    """Return the mean over places of the sum of lengths over the sum of the shortest."""
    ratios = []
    for line in lines:
        best = np.array(line["optimum"])
        both = answered(line, usage) & np.isfinite(best)
        ratios.append(answers_of(line, usage)[both, LENGTH].sum() / best[both].sum())
    return float(np.mean(ratios))


def _turning(lines: Sequence[Line], usage: str) -> float:
    ratios = []
    for line in lines:
        both = answered(line, usage) & answered(line, "grid")
        own, grid = (answers_of(line, name)[both, TURNING].mean() for name in (usage, "grid"))
        ratios.append(own / grid)
    return float(np.mean(ratios))


def _times(lines: Sequence[Line], usage: str) -> np.ndarray[Any, Any]:
    return np.concatenate([answers_of(line, usage)[answered(line, usage), SECONDS] for line in lines]) * 1e3


def _median_time(lines: Sequence[Line], usage: str) -> float:
    return float(np.median(_times(lines, usage)))


def _late_time(lines: Sequence[Line], usage: str) -> float:
    return float(np.quantile(_times(lines, usage), 0.95))


def _most_boxes(lines: Sequence[Line], usage: str) -> float:
    return max(float(line["maps"][usage]["occupied"]) for line in lines)


def _bits(lines: Sequence[Line], usage: str) -> float:
    return min(float(line["tree"][0]) / float(line["maps"][usage]["binary"]) for line in lines)


def _deflated(lines: Sequence[Line], usage: str) -> float:
    return min(float(line["tree"][2]) / float(line["maps"][usage]["binary"]) for line in lines)


def _thesis_bytes(lines: Sequence[Line], usage: str) -> float:
    return min(float(line["maps"][usage]["thesis_binary"]) / float(line["maps"][usage]["binary"]) for line in lines)


def _tops(lines: Sequence[Line], usage: str) -> float:
    return 100.0 * min(float(line["tops"][usage]) for line in lines)
