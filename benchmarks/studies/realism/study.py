"""How well robots know where they are in worlds that are not ideal."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lidarium.benchmarks.speed.harness.report import about, heading
from lidarium.benchmarks.studies.realism.episodes import (
    REPEATS,
    Run,
    corrections_of,
    measure_run,
    repeated_correction,
    team_rates,
)
from lidarium.benchmarks.studies.shared.kept import Progress, do_missing, kept_lines
from lidarium.benchmarks.studies.shared.study import Study

FLOORS = ("apartment", "clinic", "building:17", "building:23", "office:15", "office:4")
"""Floors of 50 to 430 m2."""

LARGE_OFFICE = Path("floorplans/kth/xml/A0043011__0510035741_A_40_1_104.xml.gz")
"""An office of 2,000 m2, below the folder of real data."""

TEAMS = (1, 3)
SEEDS = range(5)
REPEATED = 3
"""So many episodes with the longest corrections of the past run several times."""

RATES_FILE, EPISODES_FILE, LONGEST_FILE = "rates.jsonl", "episodes.jsonl", "longest.jsonl"

ABOUT = """\
World of `realism="lab"`: datasheet noise, typical odometry (5 % bias), SLAM; `nearest_frontier`, cells of
0.05 m. Medians over robots and seeds, in parentheses the worst. ATE is the root of the mean square over the
whole episode, of poses as they were believed at the time, after the best rigid motion (Umeyama without
scale), as `evo` and others give it. *In the frame of the start* is that without the motion: starts are
known, so the first error of a heading counts with all of its lever. IoU is of the team's map, as
[metrics](../reference/metrics.md) defines it, *aligned* after the best motion of all believed poses onto
the true ones, and *true poses* that of the map of robots that know where they are, with the same noise, in
an episode of the first seed: no localizer does better.

Wanted are an ATE of at most 0.05 m in an apartment of 65 m2 and 0.15 m in an office of 2,000 m2, IoU of at
least 0.85, at most 4 ms for a matched scan and 50 ms for a closure, and 600 agent steps a second. In the
large office robots start in a hall of which a laser of 5.6 m sees little, and drive along bare corridors:
the first degrees of heading that are lost there turn all that follows, and a map that is turned by one
degree lies two cells off after 6 m."""

HEADER = (
    "floor",
    "robots",
    "way [m]",
    "coverage",
    "ATE [m]",
    "ATE in the frame of the start [m]",
    "last pose [m]",
    "wheels alone, ATE [m]",
    "IoU occupied",
    "IoU, aligned",
    "IoU, true poses",
)


@dataclass(frozen=True, slots=True)
class Rates:
    """Speed of a team, in an episode of each seed."""

    seeds: int

    @property
    def key(self) -> str:
        """Name that no other one of its file has."""
        return f"{self.seeds} seeds"


def work(folder: Path, data: Path | None, every: int, _workers: int) -> Progress:
    """Measure every N-th pair of floor and team with all seeds.

    All is done in this process, as scans are timed.

    Raises
    ------
    FileNotFoundError
        Where the folder of real data does not hold the large office.
    """
    floors = FLOORS if data is None else (*FLOORS, str(_large_office(data)))
    teams = [(floor, robots) for floor in floors for robots in TEAMS][::every]
    runs = [Run(floor, robots, seed) for floor, robots in teams for seed in SEEDS]
    rates = [Rates(len(SEEDS))]
    yield from do_missing(folder / RATES_FILE, "speed of a team", rates, _measure_rates, 1)
    yield from do_missing(folder / EPISODES_FILE, "episodes", runs, measure_run, 1)
    longest = longest_runs(kept_lines(folder / EPISODES_FILE))
    yield from do_missing(folder / LONGEST_FILE, "longest corrections", longest, repeated_correction, 1)


def _large_office(data: Path) -> Path:
    path = Path(data) / LARGE_OFFICE
    if not path.is_file():
        raise FileNotFoundError(f"no floor {path}; want the folder floorplans there")
    return path


def _measure_rates(task: Rates) -> dict[str, Any]:
    return {"rates": team_rates(task.seeds)}


def longest_runs(episodes: Sequence[dict[str, Any]]) -> list[Run]:
    """Return the runs in which the past took longest to correct."""
    ordered = sorted(episodes, key=lambda one: -float(np.nan_to_num(corrections_of(one)).max()))
    return [Run(one["spec"], one["robots"], one["seed"]) for one in ordered[:REPEATED]]


def rows_of(episodes: list[dict[str, Any]]) -> Iterator[str]:
    """Return a line for each floor and size of team: medians, and the worst."""
    for key in dict.fromkeys((one["floor"], one["robots"]) for one in episodes):
        own = [one for one in episodes if (one["floor"], one["robots"]) == key]
        names = ("ate_m", "aligned_m", "last_m", "wheels_m", "way_m")
        ate, aligned, last, wheels, way = (np.concatenate([one[name] for one in own]) for name in names)
        coverage, iou, fitted = (
            np.array([one[name] for one in own]) for name in ("coverage", "iou", "aligned_iou")
        )
        yield (
            f"| {key[0]} | {key[1]} | {np.median(way):.0f} | {np.median(coverage):.3f} | "
            f"{np.median(aligned):.3f} ({aligned.max():.3f}) "
            f"| {np.median(ate):.3f} ({ate.max():.3f}) | {np.median(last):.3f} ({last.max():.3f}) "
            f"| {np.median(wheels):.2f} | {np.median(iou):.3f} ({iou.min():.3f}) "
            f"| {np.median(fitted):.3f} ({fitted.min():.3f}) | {own[0]['true_iou']:.3f} |"
        )


def times_of(episodes: list[dict[str, Any]], longest: Sequence[float]) -> Iterator[str]:
    """Return lines on how long scans take.

    The longest corrections were measured by themselves [s].
    """
    seconds = [entry for one in episodes for entry in one["seconds"]]
    plain = 1e3 * np.array([time for time, is_corrected in seconds if not is_corrected])
    # A scan that is not matched takes microseconds.
    matched = plain[plain > 0.2]
    most = np.quantile(matched, 0.95)
    yield f"A scan that is matched takes {np.median(matched):.2f} ms (95 % within {most:.2f} ms)."
    if not longest:
        yield "The past was corrected at none."
        return
    corrected = 1e3 * np.concatenate([corrections_of(one) for one in episodes])
    yield (
        f"One at which the past is corrected takes {np.nanmedian(corrected):.1f} ms, and the longest "
        f"{1e3 * max(longest):.1f} ms (median of "
        f"{REPEATS} runs of its episode; {np.nanmax(corrected):.1f} ms is the most that was seen once)."
    )


def page(folder: Path, command: str) -> str:
    """Return the results as markdown."""
    episodes = kept_lines(folder / EPISODES_FILE)
    rates = kept_lines(folder / RATES_FILE)[0]["rates"]
    repeated = (line["longest_s"] for line in kept_lines(folder / LONGEST_FILE))
    longest = [seconds for seconds in repeated if seconds is not None]
    speed = (
        f"Five robots on building:17 make {np.median(rates):.0f} agent steps a second on one core "
        f"({min(rates):.0f} to {max(rates):.0f}), "
        "policy, maps and localizers included."
    )
    table = [f"| {' | '.join(HEADER)} |", "|" + "---|" * len(HEADER), *rows_of(episodes)]
    lines = [
        *heading("Robots in worlds that are not ideal", about(command)),
        "",
        ABOUT,
        "",
        *table,
        "",
        *times_of(episodes, longest),
        speed,
        "",
    ]
    return "\n".join(lines)


STUDY = Study(page, work=work)
