"""Writes the report of a directory of episodes.

It has tables, plots, and all numbers behind them.
"""

import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

import lidarium
from lidarium.evaluation.analysis.episodes import Episodes, Row, name_of, read_episodes
from lidarium.evaluation.analysis.figures import values_of
from lidarium.evaluation.analysis.groups import grouped
from lidarium.evaluation.analysis.records import FOLDER, Entry, Key, read_records, record_key
from lidarium.evaluation.record import read_record
from lidarium.evaluation.report.exports import latex_table, marl_eval
from lidarium.evaluation.report.page import chosen_replays, page_content, rounded, write_page
from lidarium.evaluation.report.replay_page import replay_of
from lidarium.evaluation.report.sections import Section, describe_group
from lidarium.evaluation.report.tables import code, plain
from lidarium.mapping.files.output import check_writable, check_written, write_text

REPLAYS = 30
"""Maximum number of episodes that the page replays."""

PAGE = "report.html"
"""The page that a browser shows."""

MARL_EVAL, TABLE = "marl_eval.json", "table.tex"

Progress = Callable[[Sequence[Row]], Iterable[Row]]
"""Passes on episodes while their replays are made, and reports their number."""


def write_report(
    directory: Path,
    out: Path,
    baseline: str | None = None,
    seed: int = 0,
    replays: int = REPLAYS,
    progress: Progress = iter,
) -> dict[str, Any]:
    """Write the report of a directory's episodes.

    That is ``report.html``, ``report.md``, ``report.json``, plots, and for papers ``table.tex`` and
    ``marl_eval.json``, which the library marl-eval reads.
    """
    if replays < 0:
        raise ValueError(f"--replays is {replays}; want zero or more")
    check_writable(out)
    episodes = read_episodes(directory)
    baseline = _baseline(episodes, baseline)
    records, warnings = read_records(directory, episodes.rows)
    groups, values = grouped(episodes.rows), values_of(episodes.rows)
    sections = [describe_group(group, values, records, out, baseline, seed) for group in groups]
    replayed = chosen_replays(groups, records, replays)
    warnings = [*episodes.warnings, *_about_names(episodes), *warnings, *_about_records(episodes, records)]
    result = {
        "version": lidarium.__version__,
        "episodes_version": episodes.version,
        "episodes": len(episodes.rows),
        "records": len(records),
        "baseline": baseline,
        "confidence": 0.95,
        "seed": seed,
        "warnings": [
            *map(plain, warnings),
            *(f"{plain(section.group.title)}: {warning}" for section in sections for warning in section.warnings),
        ],
        "replays": len(replayed),
        "groups": [section.numbers for section in sections],
    }
    numbers: dict[str, Any] = jsonable(result)
    # For programs: thousands of numbers, which would otherwise take a line each.
    write_text(
        out / "report.json",
        json.dumps(numbers, allow_nan=False, ensure_ascii=False, separators=(",", ":")) + "\n",
    )
    write_text(out / "report.md", _page(result, sections))
    write_text(out / MARL_EVAL, json.dumps(marl_eval(groups, values), allow_nan=False, ensure_ascii=False) + "\n")
    write_text(out / TABLE, latex_table(groups, [section.numbers["times"]["t99_s"] for section in sections]))
    made = [replay_of(read_record(records[record_key(row)].path)) for row in progress(replayed)]
    write_page(out / PAGE, rounded(jsonable(page_content(result, sections, replayed))), made)
    pictures = [name for section in sections for name in section.numbers["pictures"]]
    check_written(out, [PAGE, "report.json", "report.md", MARL_EVAL, TABLE, *pictures])
    return numbers


def jsonable(content: Any) -> Any:  # noqa: ANN401
    """Return the same content in types that JSON knows.

    Dataclasses become objects, numbers that are not finite become null.
    """
    if is_dataclass(content) and not isinstance(content, type):
        return jsonable(asdict(content))
    if isinstance(content, dict):
        return {key: jsonable(value) for key, value in content.items()}
    if isinstance(content, list | tuple):
        return [jsonable(value) for value in content]
    if isinstance(content, np.ndarray):
        return jsonable(content.tolist())
    return None if isinstance(content, float) and not np.isfinite(content) else content


def _baseline(episodes: Episodes, baseline: str | None) -> str:
    policies = sorted({str(row["policy"]) for row in episodes.rows})
    if baseline is None:
        return "nearest_frontier" if "nearest_frontier" in policies else policies[0]
    if baseline not in policies:
        raise ValueError(
            f"--baseline is {baseline!r}, of which there are no episodes; want one of {', '.join(policies)}"
        )
    return baseline


def _about_names(episodes: Episodes) -> list[str]:
    from lidarium.agents import policy_names

    unknown = sorted({str(row["policy"]) for row in episodes.rows} - set(policy_names()))
    return (
        [f"Policies that this lidarium does not have: {', '.join(unknown)}; their figures are told all the same."]
        if unknown
        else []
    )


def _about_records(episodes: Episodes, records: dict[Key, Entry]) -> list[str]:
    missing = [row for row in episodes.rows if record_key(row) not in records]
    if not missing:
        return []
    if not records:
        return [f"There are no records in {FOLDER}/, so coverage over time, paths and visits are not drawn."]
    many = f"{len(missing)} of {len(episodes.rows)} episodes have no record, such as {name_of(missing[0])}"
    return [f"{many}; curves and pictures show the others."]


def _page(result: dict[str, Any], sections: Sequence[Section]) -> str:
    paragraphs = [
        "# Report",
        f"{result['episodes']} episodes of lidarium {result['episodes_version']}, {result['records']} of "
        "them recorded; baseline "
        f"{code(result['baseline'])}. Times are simulated. In brackets stand 95 % intervals: medians by "
        "interpolated order statistics, "
        "shares by Wilson, means, differences and ratios by the studentised bootstrap (10,000 resamples, "
        f"seed {result['seed']}), of six to ten by Student; fewer than six, and equal ones, have none. "
        "Differences and ratios of times are those of restricted means, in which a run that did not get "
        "there counts with the horizon; "
        "those of other figures are the mean difference and the geometric mean of the ratios. All numbers "
        "are in `report.json`.",
    ]
    if result["warnings"]:
        paragraphs += ["## Be careful", "\n".join(f"- {warning}" for warning in result["warnings"])]
    for section in sections:
        group = section.group
        seeds = len({row["seed"] for rows in group.runs.values() for row in rows})
        runs = sum(len(rows) for rows in group.runs.values())
        paragraphs += [
            f"## {plain(group.title)}",
            f"{runs} runs of {len(group.runs)} policies on {len(group.floors)} "
            f"floor{'s' if len(group.floors) != 1 else ''}, "
            f"{seeds} seed{'s' if seeds != 1 else ''}; times count up to {group.horizon_s:.0f} s.",
            *section.markdown,
        ]
    return "\n\n".join(paragraphs) + "\n"
