"""`lidarium report`: make a page, tables and plots of evaluated episodes."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tyro.conf import Positional

from lidarium.scripts.common import Answer, Command, counted, notify, table
from lidarium.scripts.options import FilmFiles

if TYPE_CHECKING:
    from lidarium.evaluation.analysis.episodes import Row
    from lidarium.evaluation.report.film_choice import Chosen


@dataclass(frozen=True, kw_only=True)
class _Report(FilmFiles, Command):
    """Compare policies over the episodes of a directory.

    Writes report.html, report.md, report.json and plots to --out, or to DIR/report. A film shows recorded
    episodes of one floor and seed side by side, one of each policy.
    """

    directory: Positional[Path]
    """folder with episodes.jsonl that `lidarium evaluate` wrote"""
    baseline: str | None = None
    """policy that the others are compared with.

    Nearest_frontier if it is there, else the first of the alphabet
    """
    replays: int = 30
    """most recorded episodes that run again for replays on the page, 0 for none"""
    film_floor: str | None = None
    """floor of the episodes that a film shows; by default, one that most policies have explored"""
    film_robots: int | None = None
    """number of robots of the episodes that a film shows"""
    film_seed: int | None = None
    """seed of the episodes that a film shows"""
    film_policies: tuple[str, ...] = ()
    """policies that a film shows, in this order; all of them by default, nine at most"""


def execute(command: _Report) -> Answer:
    """Write the report of a directory."""
    from lidarium.evaluation.report import write_report

    out = command.out or command.directory / "report"
    command.check_films()
    chosen = _chosen(command) if command.films else None

    def progress(rows: Sequence["Row"]) -> Iterable["Row"]:
        return counted(rows, len(rows), "replays", command.json)

    result = write_report(command.directory, out, command.baseline, command.seed, command.replays, progress)
    if chosen is not None:
        _film(command, chosen)
    return Answer(result, "\n".join([_summary(result, out), *(f"film: {path}" for path in command.films)]))


def _chosen(command: _Report) -> "Chosen":
    """Return the episodes of the films."""
    from lidarium.evaluation.report.film_choice import Wanted, choose_episodes

    wanted = Wanted(command.film_floor, command.film_robots, command.film_seed, command.film_policies)
    chosen = choose_episodes(command.directory, wanted)
    if chosen.left_out:
        notify(f"the film has no room for {', '.join(chosen.left_out)}; --film-policies chooses")
    return chosen


def _film(command: _Report, chosen: "Chosen") -> None:
    """Film episodes side by side."""
    from lidarium.evaluation.drawing.track_film import save_side_by_side
    from lidarium.evaluation.record import read_record

    records = {policy: read_record(path) for policy, path in chosen.records.items()}
    for path in command.films:
        notify(f"filming {len(records)} episode{'s' if len(records) > 1 else ''}: {chosen.title}")
        save_side_by_side(path, records, chosen.title, command.film_settings)


def _summary(result: dict[str, Any], out: Path) -> str:
    """Tell the most important figures of each group."""
    from lidarium.mapping.files.guarded_reading import printable

    lines = [f"{result['episodes']} episodes, {result['records']} recorded; compared with {result['baseline']}"]
    for group in result["groups"]:
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
            printable(group["title"]),
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
