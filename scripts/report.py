"""`lidarium report`: a page, tables and plots of episodes.

The episodes are those that `lidarium evaluate` wrote.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tyro.conf import Positional

from lidarium.scripts.common import Answer, Command, counted, table

if TYPE_CHECKING:
    from lidarium.evaluation.analysis.episodes import Row


@dataclass(frozen=True, kw_only=True)
class Report(Command):
    """Compare policies over the episodes of a directory.

    Writes report.html, report.md, report.json and plots to --out, or to DIR/report.
    """

    directory: Positional[Path]
    """folder with episodes.jsonl that `lidarium evaluate` wrote"""
    baseline: str | None = None
    """policy that the others are compared with.

    Nearest_frontier where it is there, else the first of the alphabet
    """
    replays: int = 30
    """most recorded episodes that run again for replays on the page, 0 for none"""


def execute(command: Report) -> Answer:
    """Write the report of a directory.

    Raises
    ------
    FileNotFoundError, ValueError, OSError
        Where the directory, the baseline or ``--out`` is no good; nothing is written then.
    """
    from lidarium.evaluation.report import write_report

    out = command.out or command.directory / "report"

    def progress(rows: Sequence["Row"]) -> Iterable["Row"]:
        return counted(rows, len(rows), "replays", command.json)

    result = write_report(command.directory, out, command.baseline, command.seed, command.replays, progress)
    return Answer(result, _summary(result, out))


def _summary(result: dict[str, Any], out: Path) -> str:
    """Tell the most important figures of each group."""
    lines = [
        f"{result['episodes']} episodes, {result['records']} recorded; compared with {result['baseline']}"
    ]
    for group in result["groups"]:
        robots = f"{group['robots']} robot{'s' if group['robots'] != 1 else ''}"
        rows = [
            (
                policy,
                figure["size"],
                f"{100.0 * figure['success']['estimate']:.0f} %",
                _seconds(figure["median"], group["horizon_s"]),
            )
            for policy, figure in group["times"]["t99_s"].items()
        ]
        lines += [
            "",
            f"{robots}, {group['floor_set']}",
            table(rows, ("policy", "runs", "reached 99 %", "median s")),
        ]
    lines += [
        "",
        *(f"careful: {warning}" for warning in result["warnings"]),
        f"written to {out}: report.html, report.md, report.json and plots",
    ]
    return "\n".join(lines)


def _seconds(median: dict[str, Any], horizon_s: float) -> str:
    return f"> {horizon_s:.0f}" if median["estimate"] is None else f"{median['estimate']:.1f}"
