"""Map merging: the thesis's experiments on a bank of maps that robots made, beside its tables and the pipeline of ROS map_merge."""

import json
import math
import platform
from collections.abc import Callable, Iterator
from datetime import date
from pathlib import Path
from typing import Any

import lidarium
from lidarium.evaluation.merging import figures
from lidarium.evaluation.merging.bank import Pair, drives_of, fill, read_maps, read_pairs, write_pairs
from lidarium.evaluation.merging.features import compare_descriptors, compare_detectors, compare_methods
from lidarium.evaluation.merging.floors import BankFloor, bank_floors
from lidarium.evaluation.merging.groups import merge_real_pairs, merge_teams
from lidarium.evaluation.merging.pairs import choose_pairs
from lidarium.evaluation.merging.pictures import draw_pairs
from lidarium.evaluation.merging.trials import METHODS, read_outcomes, try_pairs
from lidarium.evaluation.output import write_json

Progress = Iterator[tuple[str, int, int]]

DATA_FILE, EXTRA_FILE = "floors.json", "extra.json"

THESIS_DETECTORS = {"ours": (384, 228, 2349), "goodFeaturesToTrack": (1095, 632, 9106), "SIFT": (11321, 6510, 75746)}
"""Times of the thesis on its three maps [us]; its Shi-Tomasi is OpenCV's goodFeaturesToTrack."""


def work(folder: Path, data: Path | None, every: int, workers: int) -> Progress:
    """Fill the bank and try everything on it; what is there is not done again. Yields what is being done, how much is, and of how much."""
    floors = bank_floors(data, every)
    _check_same(folder / DATA_FILE, floors)
    total = len(drives_of(floors))
    failures = []
    for done, (drive, error) in enumerate(fill(folder, floors, workers), 1):
        if error is not None:
            failures.append(f"{drive.name}: {error}")
        yield "drives", done, total
    if failures:
        raise ValueError(f"{len(failures)} drives came to no end, the first is {failures[0]}")
    maps = read_maps(folder, floors)
    pairs = read_pairs(folder)
    if pairs is None:
        pairs = []
        for pair in choose_pairs(maps):
            pairs.append(pair)
            yield "labelled pairs", len(pairs), len(pairs)
        write_pairs(folder, pairs)
    tested = [pair for pair in pairs if pair.half == "test"]
    for method in METHODS:
        for done in try_pairs(folder / "outcomes", maps, tested, method, workers):
            yield f"pairs, {method}", done, len(tested)
    if not (folder / EXTRA_FILE).exists():
        parts: dict[str, Callable[[], Any]] = {
            "detectors": lambda: compare_detectors(maps),
            "descriptors": lambda: compare_descriptors(maps),
            "methods": lambda: compare_methods(maps, tested),
            "teams": lambda: merge_teams(maps),
            "real": lambda: [] if data is None else merge_real_pairs(data),
        }
        extra = {}
        for done, (name, measure) in enumerate(parts.items(), 1):
            extra[name] = measure()
            yield "other experiments", done, len(parts)
        write_json(folder / EXTRA_FILE, extra)


def page(folder: Path, command: str) -> str:
    """Return the results as markdown."""
    pairs = [pair for pair in read_pairs(folder) or [] if pair.half == "test"]
    tried = {method: list(zip(pairs, read_outcomes(folder / "outcomes", pairs, method), strict=True)) for method in METHODS}
    extra = json.loads((folder / EXTRA_FILE).read_text(encoding="utf-8"))
    parts = [
        "# Merging maps",
        f"Made by `{command}` on {date.today().isoformat()}: lidarium {lidarium.__version__}, Python {platform.python_version()}. How maps "
        "are merged is told in [merging maps](../reference/merging.md). Times are of the processor, medians on a machine that others "
        "share; ratios are of runs in turn.",
        _about_bank(folder, pairs),
        "## The bank\n\n" + _bank_table(tried),
        _reading(tried),
        "![Pairs of the bank: joined, refused, and a look-alike](merging_pairs.png)",
        "## By overlap and stage\n\n" + _stages(tried["default"]),
        "## Beside the thesis's bank\n\n" + _thesis(tried),
        "## Detectors\n\n" + _detectors(extra["detectors"]),
        "## Descriptors\n\n" + _descriptors(extra["descriptors"]),
        "## Matching\n\n" + _methods(extra["methods"]),
        "## Five robots\n\n" + _teams(extra["teams"]),
    ]
    if extra["real"]:
        parts.append("## Maps of real robots\n\n" + _real(extra["real"]))
    return "\n\n".join(parts) + "\n"


def pictures(folder: Path, out: Path) -> None:
    """Draw pairs of the bank beside the page."""
    floors = _kept_floors(folder / DATA_FILE)
    pairs = [pair for pair in read_pairs(folder) or [] if pair.half == "test"]
    draw_pairs(out / "merging_pairs.png", read_maps(folder, floors), pairs, read_outcomes(folder / "outcomes", pairs, "default"))


def _about_bank(folder: Path, pairs: list[Pair]) -> str:
    floors = _kept_floors(folder / DATA_FILE)
    copies = sum(floor.is_copy for floor in floors)
    all_pairs = read_pairs(folder) or []
    counts = {name: sum(pair.category == name for pair in all_pairs) for name in ("positive", "negative", "look_alike", "symmetric", "indistinct")}
    return (
        f"Robots explore {len(floors) - copies} floors (generated, drawn and real ones) and {copies} copies from which furniture was taken away, "
        "from three starts, twice from each (copies once); their maps are kept when a third, two thirds and 95 % of a floor are seen, in "
        "buildings of like rooms when 12, 35 and 90 % are. The laser has 3 cm of noise, and scans are drawn at poses that err smoothly by up to "
        "4 cm and 0.3 degrees. "
        f"The pairs, of robots from different starts: {counts['positive']} positives (from 15 % of overlap), {counts['negative']} negatives of "
        f"different floors, {counts['look_alike']} look-alikes (like rooms, or a floor and its copy) that differ by 1 m of wall or more where they "
        f"look most alike; and undecidable ones, {counts['symmetric']} symmetric positives, which another transform explains as well in truth, "
        f"and {counts['indistinct']} indistinct negatives, which differ by less. Half of the floors was for tuning; all figures are of the other "
        f"half, {len(pairs)} pairs. A positive is recalled where it is joined within 0.10 m and 1 degree at the overlap's centroid. Intervals are "
        "Clopper and Pearson's, 95 %."
    )


def _bank_table(tried: dict[str, figures.Tried]) -> str:
    names = {"default": "default", "thesis": "thesis mode", "orb": "ORB, as ROS map_merge", "akaze": "AKAZE, as ROS map_merge"}
    lines = [f"| | {' | '.join(names[method] for method in METHODS)} |", "|---|" + "---|" * len(METHODS)]
    # The peers say how sure they are; the thresholds are the least that let no negative through.
    least = {method: figures.safe_threshold(tried[method]) if method in ("orb", "akaze") else -math.inf for method in METHODS}
    rows: list[tuple[str, Callable[[str], object]]] = [
        ("recall, overlap 30 % and more", lambda one: figures.recall(tried[one], figures.is_plenty, least[one])),
        ("recall, overlap 15 to 30 %", lambda one: figures.recall(tried[one], figures.is_little, least[one])),
        ("false accepts", lambda one: figures.accepted(tried[one], figures.NEGATIVE) if math.isinf(least[one]) else f"0 above {least[one]:.2f}"),
        ("of these look-alikes", lambda one: figures.accepted(tried[one], ("look_alike",)) if math.isinf(least[one]) else "0"),
        ("positives joined far off", lambda one: figures.wrong_positives(tried[one]) if math.isinf(least[one]) else "-"),
        ("symmetric positives refused", lambda one: figures.refused(tried[one], ("symmetric",)) if math.isinf(least[one]) else "-"),
        ("indistinct negatives refused", lambda one: figures.refused(tried[one], ("indistinct",)) if math.isinf(least[one]) else "-"),
        ("error, median / 95 % [m]", lambda one: _error(tried[one]) if math.isinf(least[one]) else "-"),
        ("time a pair of 512 x 512 cells, median / 95 % [ms]", lambda one: figures.times(tried[one])),
    ]
    lines += [f"| {what} | {' | '.join(str(entry(method)) for method in METHODS)} |" for what, entry in rows]
    return "\n".join(lines)


def _error(tried: figures.Tried) -> str:
    median, p95, _ = figures.errors(tried)
    return f"{median:.3f} / {p95:.3f}"


def _reading(tried: dict[str, figures.Tried]) -> str:
    default = tried["default"]
    by_corners = figures.times(default, lambda one: one.is_accepted and one.found_by == "corners")
    standard = [one for _, one in default if one.is_standard]
    without = sum(one.is_accepted and one.found_by == "corners" for one in standard)
    little = [(pair, one) for pair, one in default if figures.is_little(pair)]
    missed = [one for _, one in little if not (one.is_accepted and one.is_exact)]
    poor = sum(one.agreeing_m < 2.5 for one in missed)
    negatives = figures.accepted(default, figures.NEGATIVE)
    return (
        f"- A pair that corners join takes {by_corners.median:.0f} ms (median, both maps described); the exhaustive fallback ran on "
        f"{100 * (1 - without / max(len(standard), 1)):.0f} % of the pairs, most of which are negatives: who is refused has been searched for "
        f"everywhere. Of all pairs of 512 x 512 cells 95 % are done in {figures.times(default).p95:.0f} ms.\n"
        f"- {negatives.hits} of {negatives.total} negatives are accepted, so the rate is below {100 * negatives.high:.2f} % (95 %).\n"
        f"- Of the {len(missed)} pairs with 15 to 30 % of overlap that are missed, {poor} have less than 2.5 m of wall in common under the best "
        "transform: the overlap is open floor, and any two rooms agree as well. What is accepted on less would be accepted of strangers too.\n"
        "- Indistinct negatives are pairs of a floor and its copy whose difference neither robot has seen, or shows less than 1 m of: both maps are "
        "the same as those of one floor, so whoever joins that floor's maps joins them. Symmetric positives that are accepted are like rooms whose "
        "wrong overlay shows more walls than the true one."
    )


def _stages(tried: figures.Tried) -> str:
    bins = (("15 to 30 %", 0.15, 0.3), ("30 to 60 %", 0.3, 0.6), ("60 % and more", 0.6, 2.0))
    lines = ["| overlap | both early | one early | none early | all |", "|---|---|---|---|---|"]
    for name, low, high in bins:
        cells = []
        for early in (2, 1, 0, None):

            def of(pair: Pair, low: float = low, high: float = high, early: int | None = early) -> bool:
                stages = [int(key.rsplit("_", 1)[1]) for key in (pair.a, pair.b)]
                return pair.category == "positive" and low <= pair.overlap < high and early in (None, stages.count(0))

            cells.append(str(figures.recall(tried, of)))
        lines.append(f"| {name} | {' | '.join(cells)} |")
    return "Recall of the default mode; early is the first of the three maps of a drive.\n\n" + "\n".join(lines)


def _thesis(tried: dict[str, figures.Tried]) -> str:
    def positives(method: str) -> figures.Share:
        return figures.recall(tried[method], lambda pair: pair.category == "positive")

    return (
        "| | pairs that overlap | joined | negatives | accepted | time a pair |\n|---|---:|---|---:|---|---|\n"
        "| thesis, its apartment of 65 m2 (errors never measured) | 10 | 40 % (4 of 10) | 2 | 0 (the rate may be up to 78 %) | 157 ms mean, "
        "302 ms worst |\n"
        + "\n".join(
            f"| {name}, this bank | {positives(method).total} | {positives(method)} | {figures.accepted(tried[method], figures.NEGATIVE).total} | "
            f"{figures.accepted(tried[method], figures.NEGATIVE)} | {figures.times(tried[method]).median:.0f} ms median, "
            f"{figures.times(tried[method]).p95:.0f} ms 95 % |"
            for method, name in (("thesis", "thesis mode"), ("default", "default mode"))
        )
        + "\n\nThe 280 ms that it claims are the longest times of its stages added up once; with both maps described its worst pair takes 302 ms."
    )


def _detectors(rows: list[dict[str, Any]]) -> str:
    names = list(rows[0]["time_us"])
    lines = [f"| image | {' | '.join(names)} | ours faster than goodFeaturesToTrack |", "|---|" + "---:|" * len(names) + "---:|"]
    for row in rows:
        cells = [f"{row['time_us'][name]:.0f} ({row['points'][name]})" for name in names]
        ratio = row["time_us"]["goodFeaturesToTrack"] / row["time_us"]["ours"]
        lines.append(f"| {row['image']} {row['shape'][1]} x {row['shape'][0]} | {' | '.join(cells)} | {ratio:.1f} x |")
    theirs = ", ".join(f"{name} {'/'.join(str(one) for one in times)}" for name, times in THESIS_DETECTORS.items())
    return (
        "Least time of 20 runs in turn [us], one thread, and points found.\n\n" + "\n".join(lines) + "\n\n"
        f"The thesis, C++ on 2.2 GHz, on maps of 146 x 144, 113 x 113 and 398 x 402 cells [us]: {theirs}; 2.8 to 3.9 times faster than "
        "Shi-Tomasi. Its rows of Harris and Shi-Tomasi are the same in six of eight columns; one was copied."
    )


def _descriptors(rows: list[dict[str, Any]]) -> str:
    names = list(rows[0]["time_us"])
    lines = [f"| image | {' | '.join(names)} |", "|---|" + "---:|" * len(names)]
    for row in rows:
        lines.append(f"| {row['image']} | {' | '.join(f'{row["time_us"][one]:.0f} ({row["points"][one]})' for one in names)} |")
    return (
        "Least time of 20 runs [us] and number of descriptors; each for the points of its own detector.\n\n" + "\n".join(lines) + "\n\n"
        "The thesis on its three maps [us]: polar 904/425/1808, log-polar 829/605/1050, SIFT 9176/5407/61673, ORB 1164/315/8704."
    )


def _methods(rows: list[dict[str, Any]]) -> str:
    lines = ["| method | matches | right ones | pairs with two right ones | best vote right | time [ms] |", "|---|---:|---:|---:|---:|---:|"]
    lines += [
        f"| {row['method']} | {row['matches']:.0f} | {row['right']:.0f} | {100 * row['two_right']:.0f} % | {100 * row['voted']:.0f} % | "
        f"{row['time_ms']:.1f} |"
        for row in rows
    ]
    return (
        f"Medians over {rows[0]['pairs']} positives with 30 % of overlap and more.\n\n" + "\n".join(lines) + "\n\n"
        "The thesis [ms]: distances 3.0, triplets 1.5, descriptors 208 and 85; with descriptors two right matches in more than 85 % of its pairs."
    )


def _teams(rows: list[dict[str, Any]]) -> str:
    lines = ["| floor | joined | largest error [m] | [deg] | time [s] |", "|---|---:|---:|---:|---:|"]
    lines += [
        f"| {row['floor']} | {row['joined']} of {row['robots']} | {row['distance_m']:.3f} | {math.degrees(row['angle']):.2f} | {row['time_s']:.2f} |"
        for row in rows
    ]
    whole = sum(row["joined"] == row["robots"] for row in rows)
    return f"The last maps of five drives of a floor, merged at once: all joined on {whole} of {len(rows)} floors.\n\n" + "\n".join(lines)


def _real(rows: list[dict[str, Any]]) -> str:
    lines = ["| pair | result | error [m] | [deg] | time [ms] |", "|---|---|---:|---:|---:|"]
    for row in rows:
        error = ("-", "-") if row["distance_m"] is None else (f"{row['distance_m']:.2f}", f"{math.degrees(row['angle']):.2f}")
        result = f"joined by {row['found_by']}" if row["is_accepted"] else row["reason"].split(";")[-1].strip().split(":")[0]
        lines.append(f"| {row['pair']} | {result} | {error[0]} | {error[1]} | {row['time_ms']:.0f} |")
    joined = sum(row["is_accepted"] for row in rows)
    return (
        f"Parts of logs of real robots, rendered with one trajectory's estimate ({joined} of {len(rows)} joined; the error is that of the best "
        "transform also where it is refused).\n\n" + "\n".join(lines)
    )


def _check_same(path: Path, floors: list[BankFloor]) -> None:
    """Note which floors the bank has; a bank of others is not gone on with.

    Raises
    ------
    ValueError
        Where the folder holds a bank of other floors or another version.
    """
    asked = {"version": lidarium.__version__, "floors": [_entry(floor) for floor in floors]}
    if path.exists() and json.loads(path.read_text(encoding="utf-8")) != asked:
        raise ValueError(f"{path.parent} holds a bank of other floors or of another version; choose another folder with --runs")
    write_json(path, asked)


def _entry(floor: BankFloor) -> dict[str, Any]:
    path = None if floor.path is None else str(floor.path)
    return {"name": floor.name, "half": floor.half, "kind": floor.kind, "seed": floor.seed, "path": path, "is_copy": floor.is_copy}


def _kept_floors(path: Path) -> list[BankFloor]:
    entries = json.loads(path.read_text(encoding="utf-8"))["floors"]
    return [BankFloor(**{**one, "path": None if one["path"] is None else Path(one["path"])}) for one in entries]


