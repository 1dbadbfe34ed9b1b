"""Section of a report on one group of episodes.

It has numbers, tables, plots, and cautions.
"""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from lidarium.evaluation.analysis.episodes import Row
from lidarium.evaluation.analysis.figures import (
    TIMES,
    TimeFigure,
    Value,
    clusters_of,
    compared,
    further_figure,
    further_keys,
    is_time,
    over_bound,
    time_figure,
    value_figure,
)
from lidarium.evaluation.analysis.groups import Group, paired, repeats, times_to
from lidarium.evaluation.analysis.records import Entry, Key
from lidarium.evaluation.drawing.floor_pictures import recorded_pair, save_paths, save_visits, visits_on
from lidarium.evaluation.drawing.plots import (
    coverage_curves,
    profiles,
    save_boxes,
    save_coverage,
    save_profiles,
)
from lidarium.evaluation.report import tables
from lidarium.evaluation.report.tables import code, plain
from lidarium.evaluation.statistics import FEWEST_FOR_INTERVAL, FEWEST_FOR_NOMINAL, Interval, median_interval

_LONGEST_STEM = 60

PICTURED_FLOORS = 3
"""Floors of each group of which paths and visits are drawn."""


_OF_FEW = (
    "95 % intervals of so few may hold the truth more or less often than that (docs/results/interval_coverage.md)."
)


@dataclass(slots=True)
class Section:
    """The section of a report about one group.

    Attributes
    ----------
    group : Group
        The episodes.
    values : tuple of Value
        Columns of tables.
    numbers : dict
        For ``report.json``.
    markdown : list of str
        Paragraphs, tables and pictures.
    warnings : list of str
        Warnings.
    """

    group: Group
    values: tuple[Value, ...]
    numbers: dict[str, Any] = field(default_factory=dict)
    markdown: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)


def describe_group(
    group: Group, values: tuple[Value, ...], records: dict[Key, Entry], out: Path, baseline: str, seed: int
) -> Section:
    """Return the section of a group and write its plots."""
    section = Section(group, values)
    section.numbers = {
        "title": group.title,
        "variant": group.variant,
        "robots": group.robots,
        "floor_set": group.floor_set,
        "floors": group.floors,
        "horizon_s": group.horizon_s,
    }
    _describe_times(section, seed)
    _describe_values(section, seed)
    _describe_comparisons(section, baseline, seed)
    _draw_plots(section, records, out)
    _draw_floors(section, records, out)
    _describe_floors(section)
    return section


def _describe_times(section: Section, seed: int) -> None:
    group = section.group
    section.numbers["times"] = {}
    section.numbers["over_bound"] = {
        policy: over_bound(rows, group.horizon_s, seed) for policy, rows in group.runs.items()
    }
    for key, title in TIMES.items():
        figures = {policy: time_figure(rows, key, group.horizon_s, seed) for policy, rows in group.runs.items()}
        section.numbers["times"][key] = figures
        section.markdown += [
            f"### {title[0].upper()}{title[1:]}",
            tables.times_table(figures, group.horizon_s),
        ]
        if key == "t99_s" and any(section.numbers["over_bound"].values()):
            section.markdown.append(tables.over_bound_table(section.numbers["over_bound"]))
        if missed := [_missed(policy, figure) for policy, figure in figures.items() if figure.reached < figure.size]:
            section.warnings.append(f"{title} was not reached in {', '.join(missed)}.")
    # Runs, or floors if these are the clusters.
    units = {policy: len(set(clusters_of(rows) or range(len(rows)))) for policy, rows in group.runs.items()}
    few = [f"{code(policy)} ({number})" for policy, number in units.items() if number < FEWEST_FOR_NOMINAL]
    if any(units[policy] < len(rows) for policy, rows in group.runs.items()):
        section.markdown.append("Runs on one floor are not independent: intervals and tests are over floors.")
    elif any(len(rows) > len(group.floors) for rows in group.runs.values()):
        section.markdown.append(
            f"Intervals and tests are over runs on the same {len(group.floors)} floors and say nothing about others; "
            f"{FEWEST_FOR_INTERVAL} floors are the fewest for that."
        )
    if any(number < FEWEST_FOR_INTERVAL for number in units.values()):
        section.markdown.append(f"A figure without brackets has no interval: of fewer than {FEWEST_FOR_INTERVAL}.")
    if again := [
        f"{repeats(rows)} of {len(rows)} of {code(policy)}" for policy, rows in group.runs.items() if repeats(rows)
    ]:
        section.warnings.append(
            f"runs that repeat another one on their floor in every figure: {', '.join(again)}. The seed "
            "changed nothing there, so they "
            "are no further evidence: intervals are too narrow and p values too small."
        )
    if few:
        section.warnings.append(f"fewer than {FEWEST_FOR_NOMINAL} independent runs of {', '.join(few)}: {_OF_FEW}")


def _missed(policy: str, figure: TimeFigure) -> str:
    missed = figure.size - figure.reached
    cut = f", {figure.cut} cut before the horizon" if figure.cut else ""
    censored = f"{100.0 * missed / figure.size:.0f} % censored{cut}"
    return f"{missed} of {figure.size} runs of {code(policy)} ({censored})"


def _describe_values(section: Section, seed: int) -> None:
    figures = {
        policy: {
            value.column.key: value_figure(
                [value.of(row) for row in rows], seed, clusters_of(rows), value.column.bounds
            )
            for value in section.values
        }
        for policy, rows in section.group.runs.items()
    }
    section.numbers["values"] = figures
    section.markdown += ["### Coverage, paths, overlap", tables.values_table(figures, section.values)]
    further = {
        policy: {key: further_figure(rows, key) for key in further_keys(rows, section.values)}
        for policy, rows in section.group.runs.items()
    }
    section.numbers["further_medians"] = further
    if text := tables.further_table(further, section.group.horizon_s):
        section.markdown += ["### Further figures", text]
        if lacking := _lacking(section.group.runs, further):
            section.markdown.append(f"Of the runs that have it: {', '.join(lacking)}.")


def _lacking(runs: Mapping[str, Sequence[Row]], further: Mapping[str, Mapping[str, Interval]]) -> list[str]:
    """Return which figures some runs lack, and how many have them."""
    found = []
    for key in next(iter(further.values())):
        numbers = [
            f"{sum(row[key] is not None for row in rows)} of {len(rows)} of {code(policy)}"
            for policy, rows in runs.items()
            if key in further[policy] and not is_time(key) and any(row[key] is None for row in rows)
        ]
        if numbers:
            found.append(f"{code(key)} ({', '.join(numbers)})")
    return found


def _describe_comparisons(section: Section, baseline: str, seed: int) -> None:
    group = section.group
    section.numbers["comparisons"] = []
    others = [policy for policy in group.runs if policy != baseline]
    if baseline not in group.runs:
        section.warnings.append(
            f"there are no runs of the baseline {code(baseline)} here, so policies are not compared."
        )
        return
    if not others:
        return
    comparisons = compared(group, section.values, baseline, seed)
    section.numbers["comparisons"] = comparisons
    _warn_of_pairs(section, others, baseline)
    if comparisons:
        section.markdown += [
            f"### Compared with {code(baseline)}, pair by pair",
            tables.comparisons_table(comparisons, section.values),
        ]
        section.markdown.append(
            "Policy less baseline, policy over baseline. Wilcoxon's signed rank test and the sign test leave out pairs "
            f"that are the same; Holm's correction is for the {len(comparisons)} comparisons of this table. A "
            "difference in bold is beyond chance at 5 % by its p of Holm and by its interval; one with a dagger by its "
            "p of Holm alone: most runs differ, but their mean may not, and neither is trusted. P(better) is the "
            "probability that a run of the policy beats one of the baseline on the same floor."
        )


def _warn_of_pairs(section: Section, others: Sequence[str], baseline: str) -> None:
    theirs = section.group.runs[baseline]
    few, unpaired = [], []
    for policy in others:
        ours = section.group.runs[policy]
        pairs = len(paired(ours, theirs)[0])
        if pairs < FEWEST_FOR_NOMINAL:
            few.append(f"{code(policy)} ({pairs})")
        if left := len(ours) + len(theirs) - 2 * pairs:
            unpaired.append(f"{left} of {code(policy)} or {code(baseline)}")
    if few:
        section.warnings.append(
            f"fewer than {FEWEST_FOR_NOMINAL} pairs with {code(baseline)}: {', '.join(few)}: {_OF_FEW}"
        )
    if unpaired:
        section.warnings.append(
            "runs without a partner on the same floor, starts and seed were left out of comparisons: "
            f"{', '.join(unpaired)}."
        )


def _draw_plots(section: Section, records: dict[Key, Entry], out: Path) -> None:
    group = section.group
    curves = coverage_curves(group, records)
    section.numbers["coverage_over_time"] = curves
    section.numbers["profiles"] = profiles(group)
    section.numbers["pictures"] = []
    if curves:
        save_coverage(_picture(section, out, f"coverage_{group.slug}.png", "Coverage over time"), group, curves)
    picture = _picture(section, out, f"boxes_{group.slug}.png", "Times, paths and overlap")
    save_boxes(picture, group, section.values)
    save_profiles(
        _picture(section, out, f"profiles_{group.slug}.png", "Performance profiles"),
        group,
        section.numbers["profiles"],
    )


def _draw_floors(section: Section, records: dict[Key, Entry], out: Path) -> None:
    group = section.group
    section.numbers["visits"] = {}
    recorded = [floor for floor in group.floors if recorded_pair(group, floor, records)]
    for floor in recorded[:PICTURED_FLOORS]:
        name = _file_stem(floor, group.floors)
        save_paths(
            _picture(section, out, f"paths_{name}_{group.slug}.png", f"Paths on {plain(floor)}"),
            group,
            floor,
            records,
        )
        visits, tracks = visits_on(group, floor, records)
        section.numbers["visits"][floor] = {
            policy: {"runs": each.runs, "extent_m": each.extent, "seconds": np.round(each.seconds, 2)}
            for policy, each in visits.items()
        }
        save_visits(
            _picture(section, out, f"visits_{name}_{group.slug}.png", f"Visits on {plain(floor)}"),
            group,
            floor,
            visits,
            tracks,
        )
    if len(recorded) > PICTURED_FLOORS:
        section.markdown.append(
            f"Paths and visits are drawn of the first {PICTURED_FLOORS} of {len(recorded)} recorded floors."
        )


def _file_stem(floor: str, floors: Sequence[str]) -> str:
    """Return a part of a file's name for a floor, no other floor's."""
    stems = ["".join(letter if letter.isalnum() else "_" for letter in each) for each in floors]
    stem = stems[list(floors).index(floor)]
    if len(stem) <= _LONGEST_STEM and stems.count(stem) == 1:
        return stem
    digest = hashlib.sha256(floor.encode("utf-8", "replace")).hexdigest()
    return f"{stem[-_LONGEST_STEM:]}_{digest[:8]}"


def _picture(section: Section, out: Path, name: str, title: str) -> Path:
    section.numbers["pictures"].append(name)
    section.markdown.append(f"![{title}]({name})")
    return out / name


def _describe_floors(section: Section) -> None:
    group = section.group
    section.numbers["by_floor"] = {
        floor: {policy: _of_floor(rows, group.horizon_s) for policy, rows in group.on_floor(floor).items() if rows}
        for floor in group.floors
    }
    for key, title in TIMES.items():
        section.markdown += [
            f"### By floor: {title}, median [s] (runs that got there / runs)",
            tables.floors_table(group, key),
        ]


def _of_floor(rows: Sequence[Row], horizon_s: float) -> dict[str, Any]:
    found: dict[str, Any] = {
        "runs": len(rows),
        "coverage_percent": float(np.median([100.0 * row["coverage_final"] for row in rows])),
    }
    for key in TIMES:
        times = times_to(rows, key, horizon_s)
        found[key] = {
            "reached": int(times.is_reached.sum()),
            "median_s": median_interval(times.or_never).estimate,
        }
    return found
