"""Results of a benchmark: the rows of reference policies and of a newcomer, their table, page and card."""

import json
import lzma
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import lidarium
from lidarium.evaluation.analysis.episodes import NoEpisodesError, Row, read_episodes
from lidarium.evaluation.analysis.groups import times_to
from lidarium.evaluation.benchmark.tasks import DATA, Benchmark, BenchmarkTask, Size, starts_hash
from lidarium.evaluation.report.report import jsonable, write_report
from lidarium.evaluation.report.tables import NONE, code, interval, markdown_table, plain
from lidarium.evaluation.statistics import (
    Interval,
    mean_share_interval,
    median_interval,
    paired_ratio,
    probability_of_improvement,
)
from lidarium.evaluation.suites.campaign import EPISODES_FILE
from lidarium.evaluation.suites.episodes_file import KEY, TIMINGS
from lidarium.mapping.files.output import write_text

RESULTS, TABLE, CARD, ALL = "results.json", "table.md", "card.md", "all"
_REACHED = "t99_s"


@dataclass(frozen=True, slots=True)
class Standing:
    """A policy in a task.

    Attributes
    ----------
    task, policy : str
        Their names.
    is_reference : bool
        Whether its rows are those that the benchmark ships.
    runs, asked : int
        Episodes that there are, and that the size asks for.
    success : Interval
        Share of the runs that saw 99 %.
    time_s : Interval
        Median time to 99 % [s]; inf is later than the horizon.
    is_baseline : bool
        Whether ratios are of this policy.
    ratio : Interval or None
        Time over the baseline's on the same floors, geometric mean; times not reached are the horizon. None for the
        baseline, and if there are no rows of it.
    improvement : Interval or None
        Probability that a run is sooner than the baseline's on the same floor.
    """

    task: str
    policy: str
    is_reference: bool
    is_baseline: bool
    runs: int
    asked: int
    success: Interval
    time_s: Interval
    ratio: Interval | None
    improvement: Interval | None


@dataclass(frozen=True, slots=True)
class BenchmarkResults:
    """All that came out.

    Attributes
    ----------
    standings : tuple of Standing
        By task, the soonest first.
    overall : dict
        By policy: geometric mean of its ratios, and the number of tasks that it is over.
    remarks : tuple of str
        Remarks for the reader.
    """

    benchmark: str
    size: Size
    version: str
    standings: tuple[Standing, ...]
    overall: Mapping[str, tuple[float, int]]
    remarks: tuple[str, ...]


def reference_rows(name: str) -> dict[str, list[Row]]:
    """Return the shipped rows of reference policies by task; none for a benchmark without any."""
    path = DATA / rows_file(name)
    if not path.is_file():
        return {}
    rows: dict[int, Row] = {}
    for line in lzma.decompress(path.read_bytes()).decode("utf-8").splitlines():
        column, numbers, values = json.loads(line)
        for number, value in zip(range(len(values)) if numbers is None else numbers, values, strict=True):
            rows.setdefault(number, {})[column] = value
    by_task: dict[str, list[Row]] = {}
    for number in sorted(rows):
        by_task.setdefault(rows[number]["variant"], []).append(rows[number])
    return by_task


def rows_file(name: str) -> str:
    """Return the file of a benchmark's shipped rows, in the folder of its data."""
    return f"{name}.rows.jsonl.xz"


NOT_SHIPPED = (
    *TIMINGS,
    *("record", "operating", "given_up"),
    *("d85_m", "d90_m", "d95_m", "d_sum85_m", "d_sum90_m", "d_sum95_m", "d_sum99_m", "n85", "n90", "n95"),
    *(
        "path_balance",
        "balance",
        "c_known_final",
        "c_valid_final",
        "overlap_eb",
        "overlap_mv",
        "overlap_mx_85",
        "overlap_mx_95",
    ),
)
"""What differs between two runs of one episode, and lists and figures of other projects that no page shows."""


def packed(rows: Iterable[Row]) -> bytes:
    """Return rows as the package ships them, without `NOT_SHIPPED`.

    Each line is a column: its name, the numbers of the rows that have it (null for all) and their values; a fifth is
    saved by columns.
    """
    kept = sorted(rows, key=lambda row: row[KEY])
    lines = []
    for column in sorted({key for row in kept for key in row} - set(NOT_SHIPPED)):
        numbers = [number for number, row in enumerate(kept) if column in row]
        values = [kept[number][column] for number in numbers]
        line = (column, None if len(numbers) == len(kept) else numbers, values)
        lines.append(json.dumps(line, sort_keys=True, separators=(",", ":")))
    filters = [{"id": lzma.FILTER_LZMA2, "preset": 9 | lzma.PRESET_EXTREME, "lc": 4, "lp": 0, "pb": 0}]
    return lzma.compress("\n".join(lines).encode("utf-8"), filters=filters)


def collect(
    found: Benchmark, tasks: Sequence[BenchmarkTask], size: Size, folder: Path, failures: Mapping[tuple[str, str], str]
) -> BenchmarkResults:
    """Compare the episodes in a folder with those of the reference policies, and write table, page and card.

    Parameters
    ----------
    failures : dict
        By task and policy: why some of its episodes, or all of them, are missing.
    """
    shipped, everything, standings, remarks = reference_rows(found.name), [], [], []
    for task in tasks:
        own = [row for row in _rows_in(folder / task.name) if _floor_of(row) in task.floors_of(size)]
        rows, wrong = _as_frozen(task, own)
        remarks += wrong
        theirs = [row for row in shipped.get(task.name, ()) if _floor_of(row) in task.floors_of(size)]
        remarks += _repeated(task, rows, theirs)
        own, partial = _instead(task, size, rows, theirs)
        remarks += partial
        mine = {row["policy"] for row in own}
        rest = [row for row in theirs if row["policy"] not in mine]
        standings += _standings(task, size, own, rest)
        everything += [*own, *rest]
    remarks += [f"{task}, {policy}: {why}" for (task, policy), why in failures.items()]
    versions = sorted({str(row["version"]) for row in everything})
    if len(versions) > 1:
        remarks.append(
            f"Rows are of lidarium {' and '.join(versions)}. The tasks' floors, starts and settings are the same; "
            "policies and SLAM may have changed."
        )
    compared = {each.task for each in standings if each.is_baseline}
    remarks += [
        f"{task.name}: there are no rows of its baseline {task.baseline}, so nothing is compared; run it with "
        "--reference."
        for task in tasks
        if task.name not in compared
    ]
    short = [each for each in standings if each.runs < each.asked]
    remarks += [f"{each.task}, {each.policy}: {each.runs} of {each.asked} runs." for each in short]
    results = BenchmarkResults(
        found.name, size, lidarium.__version__, tuple(standings), _overall(standings), tuple(remarks)
    )
    _write(found, tasks, results, everything, folder)
    return results


def _rows_in(folder: Path) -> list[Row]:
    """Return the finished episodes in a folder; none if it is missing, or if all of them failed."""
    try:
        return list(read_episodes(folder).rows)
    except (FileNotFoundError, NoEpisodesError):
        return []


def _as_frozen(task: BenchmarkTask, rows: Sequence[Row]) -> tuple[list[Row], list[str]]:
    """Return the rows whose settings, floor and starts are the benchmark's, and the faults of the others."""
    if task.hashes is None:
        return list(rows), []
    frozen = dict(zip(task.floors, zip(task.hashes.floors, task.hashes.starts, strict=True), strict=True))
    kept: list[Row] = []
    wrong: dict[tuple[str, str], list[str]] = {}
    for row in rows:
        floor, starts = frozen[_floor_of(row)]
        for what, now, before in (
            ("settings", row["settings_sha256"][:16], task.hashes.settings),
            ("floor", row["floor_sha256"][:16], floor),
            ("starts", starts_hash(row["starts"]), starts),
        ):
            if now != before:
                why = f"{_floor_of(row)} ({now}, in the benchmark {before})"
                wrong.setdefault((row["policy"], what), []).append(why)
                break
        else:
            kept.append(row)
    return kept, [
        f"{task.name}, {policy}: {len(found)} runs left out, for their {what} have other hashes, first on {found[0]}."
        for (policy, what), found in wrong.items()
    ]


def _repeated(task: BenchmarkTask, rows: Sequence[Row], shipped: Sequence[Row]) -> list[str]:
    """Return how the rows of reference policies that ran here compare with those shipped."""
    known = {row[KEY]: row for row in shipped}
    pairs = [(row, known[row[KEY]]) for row in rows if row[KEY] in known]
    # Metrics that came later are in no shipped row.
    others = [(row, other) for row, other in pairs if packed([{key: row.get(key) for key in other}]) != packed([other])]
    if not others:
        return [f"{task.name}: {len(pairs)} rows ran again, all as shipped."] if pairs else []
    horizon_s = float(task.settings["horizon_s"])
    times = [[next(iter(_times([row], horizon_s).values())) for row in pair] for pair in others]
    worst = max(abs(here / there - 1.0) for here, there in times)
    return [
        f"{task.name}: {len(pairs)} rows ran again, {len(others)} not as shipped; times differ by up to {worst:.1%}: "
        "this version, or a library below it, does not run the task as published."
    ]


def _instead(
    task: BenchmarkTask, size: Size, rows: Sequence[Row], shipped: Sequence[Row]
) -> tuple[list[Row], list[str]]:
    """Return the rows that are shown instead of shipped ones, and which are not.

    A part of the rows of a reference policy does not replace those that are shipped: all others would be compared on
    that part.
    """
    floors: dict[str, set[str]] = {row["policy"]: set() for row in rows}
    for row in rows:
        floors[row["policy"]].add(_floor_of(row))
    asked, known = set(task.floors_of(size)), {row["policy"] for row in shipped}
    left = [policy for policy, found in floors.items() if policy in known and found < asked]
    return [row for row in rows if row["policy"] not in left], [
        f"{task.name}, {policy}: {len(floors[policy])} of {len(asked)} runs here, so its shipped rows are shown."
        for policy in left
    ]


def _standings(task: BenchmarkTask, size: Size, own: Sequence[Row], theirs: Sequence[Row]) -> list[Standing]:
    by_policy: dict[str, list[Row]] = {}
    for row in (*own, *theirs):
        by_policy.setdefault(row["policy"], []).append(row)
    mine = {row["policy"] for row in own}
    horizon_s = float(task.settings["horizon_s"])
    baseline = _times(by_policy.get(task.baseline, ()), horizon_s)
    found = []
    for policy, rows in by_policy.items():
        times = _times(rows, horizon_s)
        floors = sorted(set(times) & set(baseline))
        a, b = [times[floor] for floor in floors], [baseline[floor] for floor in floors]
        reached = times_to(rows, _REACHED, horizon_s)
        is_compared = bool(floors) and policy != task.baseline
        found.append(
            Standing(
                task.name,
                policy,
                policy not in mine,
                policy == task.baseline,
                len(rows),
                len(task.floors_of(size)),
                mean_share_interval(reached.is_reached),
                median_interval(reached.or_never),
                paired_ratio(a, b) if is_compared else None,
                probability_of_improvement(a, b) if is_compared else None,
            )
        )
    return sorted(found, key=lambda each: (1.0 if each.ratio is None else each.ratio.estimate, each.policy))


def _times(rows: Iterable[Row], horizon_s: float) -> dict[str, float]:
    """Return the time to 99 % on each floor, the horizon if it was not reached."""
    return {_floor_of(row): horizon_s if row[_REACHED] is None else row[_REACHED] for row in rows}


def _floor_of(row: Row) -> str:
    """Return the floor by the name that was asked for; ``building:17`` calls itself by its kind."""
    return str(row[KEY].split(" | ")[1])


def _overall(standings: Sequence[Standing]) -> dict[str, tuple[float, int]]:
    ratios: dict[str, list[float]] = {}
    for each in standings:
        if each.ratio is not None and each.runs == each.asked:  # another part of the floors is another task
            ratios.setdefault(each.policy, []).append(each.ratio.estimate)
    means = {policy: (math.exp(sum(map(math.log, found)) / len(found)), len(found)) for policy, found in ratios.items()}
    return dict(sorted(means.items(), key=lambda item: item[1][0]))


def _write(
    found: Benchmark, tasks: Sequence[BenchmarkTask], results: BenchmarkResults, rows: Sequence[Row], folder: Path
) -> None:
    write_text(folder / TABLE, table_of(tasks, results))
    write_text(folder / CARD, _card_of(found, tasks, results))
    write_text(folder / RESULTS, json.dumps(jsonable(asdict(results)), indent=1, allow_nan=False) + "\n")
    if rows:
        # The page's reader wants one version; which there were is among the remarks.
        lines = [{KEY: row[KEY], **row, "version": lidarium.__version__, "record": None} for row in rows]
        write_text(folder / ALL / EPISODES_FILE, "".join(json.dumps(line) + "\n" for line in lines))
        write_report(folder / ALL, folder / "report")


def table_of(tasks: Sequence[BenchmarkTask], results: BenchmarkResults) -> str:
    """Return the table as markdown."""
    header = ("task", "policy", "runs", "99 % [%]", "time to 99 % [s]", "time relative to the baseline", "P(sooner)")
    horizons = {task.name: float(task.settings["horizon_s"]) for task in tasks}
    lines = []
    for each in results.standings:
        name = code(each.policy)
        lines.append(
            (
                each.task,
                name if each.is_reference else f"**{name}**",
                str(each.runs) if each.runs == each.asked else f"{each.runs} of {each.asked}",
                f"{100.0 * each.success.estimate:.0f}",
                interval(each.time_s, horizons[each.task], digits=0),
                "baseline" if each.is_baseline else interval(each.ratio, digits=3),
                interval(each.improvement, digits=2),
            )
        )
    overall = [(code(policy), f"{mean:.3f}", str(number)) for policy, (mean, number) in results.overall.items()]
    parts = [
        f"# {results.benchmark}, size {results.size}",
        "Brackets contain 95 % intervals over floors. Policies in bold ran here; rows of the others are shipped. The "
        "time relative to the baseline is a geometric mean over floors with the same starts; a run that did not see "
        "99 % counts as the horizon.",
        markdown_table(header, lines) if lines else "No rows.",
        "## Over all tasks",
        "Geometric mean of the ratios of the tasks that a policy ran in, each with the same weight.",
        markdown_table(("policy", "time relative to the baselines", "tasks"), overall) if overall else NONE,
    ]
    if results.remarks:
        parts += ["## Remarks", "\n".join(f"- {plain(remark)}" for remark in results.remarks)]
    return "\n\n".join(parts) + "\n"


def _card_of(found: Benchmark, tasks: Sequence[BenchmarkTask], results: BenchmarkResults) -> str:
    """Return the card: tasks, rules, floors and licences, how to cite, and the runs."""
    header = ("id", "task", "robots", "floors, easy / full", "baseline", "settings")
    rows = [
        (
            f"`{task.id}`",
            task.about,
            str(task.robots),
            f"{task.easy} / {len(task.floors)}",
            f"`{task.baseline}`",
            "" if task.hashes is None else f"`{task.hashes.settings}`",
        )
        for task in tasks
    ]
    template = (DATA / f"{found.name}.md").read_text(encoding="utf-8")
    ran = sorted({each.policy for each in results.standings if not each.is_reference})
    text = template.format(
        tasks=markdown_table(header, rows),
        version=results.version,
        size=results.size,
        policies=", ".join(map(code, ran)) or "none",
        remarks="\n".join(f"- {plain(remark)}" for remark in results.remarks),
    )
    return text.rstrip() + "\n"
