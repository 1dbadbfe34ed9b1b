"""The tables of the page on map merging, each besides what the thesis printed."""

import math
from collections.abc import Callable, Mapping
from typing import Any

from lidarium.benchmarks.results_page import in_file
from lidarium.benchmarks.studies.merging import figures, thesis
from lidarium.benchmarks.studies.merging.bank.bank import Pair
from lidarium.benchmarks.studies.merging.features import BURST, REPEATS
from lidarium.benchmarks.studies.merging.peers import FEATURES

POOR_M = 3.5
"""Walls in common that are too few to tell one room from another [m]."""


def bank_table(tried: dict[str, figures.Tried]) -> str:
    """Return the figures of all methods on the bank."""
    lines = ["| | default | thesis mode |", "|---|---|---|"]
    rows: list[tuple[str, Callable[[figures.Tried], object]]] = [
        ("recall, overlap 30 % and more", lambda one: figures.recall(one, figures.is_plenty)),
        ("recall, overlap 15 to 30 %", lambda one: figures.recall(one, figures.is_little)),
        ("recall, furniture taken away", lambda one: figures.recall(one, figures.is_refurnished)),
        ("false accepts", lambda one: figures.accepted(one, figures.NEGATIVE)),
        ("of these look-alikes", lambda one: figures.accepted(one, ("look_alike",))),
        ("positives joined far off", figures.wrong_positives),
        ("symmetric positives refused", lambda one: figures.refused(one, ("symmetric",))),
        ("indistinct negatives refused", lambda one: figures.refused(one, ("indistinct",))),
        ("error, median / 95 % [m]", _error),
        ("time a pair of 512 x 512 cells, median / 95 % [ms]", figures.times),
        ("the same without the fallback", lambda one: figures.times(one, lambda outcome: not outcome.needed_fallback)),
    ]
    lines += [f"| {what} | {entry(tried['default'])} | {entry(tried['thesis'])} |" for what, entry in rows]
    return "\n".join(lines)


def peers(tried: dict[str, figures.Tried]) -> str:
    """Return the results of the ROS map_merge pipeline on the bank. They are for a range of its thresholds."""
    thresholds = ("any", "its own, 1.0", "no stranger accepted", "no negative accepted")
    lines = [
        "| features | threshold of confidence | recall, overlap 30 % and more | strangers accepted | "
        "look-alikes accepted | time [ms] |",
        "|---|---|---|---:|---:|---:|",
    ]
    for method in FEATURES:
        one = tried[method]
        values = (0.0, 1.0, figures.safe_threshold(one, ("negative",)), figures.safe_threshold(one))
        for name, value in zip(thresholds, values, strict=True):
            shares = [figures.accepted(one, (category,), value) for category in figures.NEGATIVE]
            wrong = [f"{share.hits} of {share.total}" for share in shares]
            cells = [f"{name} ({value:.2f})", figures.recall(one, figures.is_plenty, value), *wrong, figures.times(one)]
            lines.append(f"| {method.upper()} | {' | '.join(str(cell) for cell in cells)} |")
    return (
        "The pipeline of ROS map_merge (features, ratio test, an affine motion without shear by RANSAC, from OpenCV's "
        "stitching) returns a confidence, for which users set a threshold. SIFT replaces AKAZE, which OpenCV 5 does "
        "not have.\n\n" + in_file("\n".join(lines)) + "\n\n"
        "No threshold separates look-alikes from positives: a floor and its copy are nearly the same image."
    )


def _error(tried: figures.Tried) -> str:
    median, p95, _ = figures.errors(tried)
    return f"{median:.3f} / {p95:.3f}"


def reading(tried: dict[str, figures.Tried]) -> str:
    """Tell what the figures of the default mode mean."""
    default = tried["default"]
    without = figures.times(default, lambda one: not one.needed_fallback)
    every = figures.times(default)
    joined = figures.times(default, lambda one: one.is_accepted)
    little = [(pair, one) for pair, one in default if figures.is_little(pair)]
    missed = [one for _, one in little if not (one.is_accepted and one.is_exact)]
    poor = sum(one.agreeing_m < POOR_M for one in missed)
    plenty = [one for pair, one in default if figures.is_plenty(pair) and not (one.is_accepted and one.is_exact)]
    refused = sum(one.is_exact for one in plenty)
    inexact = sum(one.is_accepted for one in plenty)
    return (
        f"- Without the fallback a pair of 512 x 512 cells takes {without.median:.0f} ms (median, both maps "
        f"described). The fallback ran on {100 * (1 - without.count / max(every.count, 1)):.0f} % of these pairs, most "
        f"of which are negatives. Pairs that are joined take {joined.median:.0f} ms (median).\n- Of the {len(plenty)} "
        f"missed pairs with at least 30 % of overlap, {refused} were found in the right place and refused, because too "
        f"little wall supports it or more supports a similar place, and {inexact} joined less exactly than is counted "
        f"as right.\n- Of the {len(missed)} missed pairs with 15 to 30 %, {poor} have less than {POOR_M:g} m of wall "
        "in common: both maps know open floor there, on which any two rooms agree.\n- Accepted indistinct negatives "
        "are like rooms that differ by less than 1 m of wall; accepted symmetric positives are like rooms whose wrong "
        "overlay shows more walls than the true one."
    )


def by_stage(tried: figures.Tried) -> str:
    """Return the recall by overlap and by how early the maps are."""
    bins = (("15 to 30 %", 0.15, 0.3), ("30 to 60 %", 0.3, 0.6), ("60 % and more", 0.6, 2.0))
    lines = ["| overlap | both early | one early | none early | all |", "|---|---|---|---|---|"]
    for name, low, high in bins:
        cells = []
        for early in (2, 1, 0, None):

            def of(pair: Pair, low: float = low, high: float = high, early: int | None = early) -> bool:
                stages = [int(key.rsplit("_", 1)[1]) for key in (pair.a, pair.b)]
                return (
                    pair.category in figures.SAME_PLACE
                    and low <= pair.overlap < high
                    and early in (None, stages.count(0))
                )

            cells.append(str(figures.recall(tried, of)))
        lines.append(f"| {name} | {' | '.join(cells)} |")
    return "Recall of the default mode; early is the first of the three maps of a drive.\n\n" + in_file(
        "\n".join(lines)
    )


def beside_thesis(tried: dict[str, figures.Tried]) -> str:
    """Return the thesis's bank beside both modes on this one."""
    known = figures.Share(sum(pair.is_accepted for pair in thesis.PAIRS), thesis.OVERLAPPING)
    strangers = figures.Share(0, len(thesis.PAIRS) - thesis.OVERLAPPING)
    spent = [thesis.pair_ms(pair) for pair in thesis.PAIRS]
    lines = [
        "| | pairs that overlap | joined | negatives accepted | time a pair |",
        "|---|---:|---|---|---|",
        f"| thesis, an apartment of 65 m2 (errors never measured) | {known.total} | {100 * known.value:.0f} % "
        f"({known.hits} of {known.total}) | 0 of {strangers.total} (the rate may be up to {100 * strangers.high:.0f} "
        f"%) | {sum(spent) / len(spent):.0f} ms mean, {max(spent):.0f} ms worst |",
    ]
    for method, name in (("thesis", "thesis mode"), ("default", "default mode")):
        positives = figures.recall(tried[method], lambda pair: pair.category in figures.SAME_PLACE)
        times = figures.times(tried[method])
        negatives = figures.accepted(tried[method], figures.NEGATIVE)
        lines.append(
            f"| {name}, this bank | {positives.total} | {positives} | {negatives} | {times.median:.0f} ms "
            f"median, {times.p95:.0f} ms 95 % |"
        )
    return (
        "\n".join(lines) + "\n\nThe thesis claims 280 ms, the sum of the longest times of its stages "
        f"({thesis.claimed_ms():.0f} ms)."
    )


def detectors(rows: list[dict[str, Any]]) -> str:
    """Return times and points of the detectors."""
    names = list(rows[0]["time_us"])
    lines = [
        f"| image | {' | '.join(names)} | ours faster than goodFeaturesToTrack |",
        "|---|" + "---:|" * len(names) + "---:|",
    ]
    for row in rows:
        cells = [f"{row['time_us'][name]:.0f} ({row['points'][name]})" for name in names]
        ratio = row["time_us"]["goodFeaturesToTrack"] / row["time_us"]["ours"]
        lines.append(f"| {row['image']} {row['shape'][1]} x {row['shape'][0]} | {' | '.join(cells)} | {ratio:.1f} x |")
    ratios = [row["time_us"]["goodFeaturesToTrack"] / row["time_us"]["ours"] for row in rows]
    return (
        f"Least time of {REPEATS} turns of {BURST} runs each [us], one thread, and points found; Trajkovic"
        " and Hedley in numpy, all others compiled.\n\n"
        + in_file("\n".join(lines))
        + f"\n\nOurs is {min(ratios):.1f} to {max(ratios):.1f} times faster than goodFeaturesToTrack (Shi-Tomasi); the "
        "thesis's was 2.8 to 3.9 times faster. "
        + _stabilities(rows)
        + "\n\nThe thesis, C++ on 2.2 GHz, on maps of 146 x 144, 113 x 113 and 398 x 402 cells [us]: "
        f"{_printed(thesis.DETECTORS_US)}. Its rows of Harris and Shi-Tomasi are the same in six of eight columns: one "
        "was copied."
    )


def _stabilities(rows: list[dict[str, Any]]) -> str:
    """Return the least share of points that a detector finds in all runs, if that was measured."""
    if not all("stable" in row for row in rows):
        return ""
    least = min(share for row in rows for share in row["stable"].values())
    return (
        f"The least share of points that a detector finds in all of {REPEATS} runs is {100 * least:.0f} % (the thesis: "
        "100 %)."
    )


def descriptors(rows: list[dict[str, Any]]) -> str:
    """Return times of the descriptors."""
    names = list(rows[0]["time_us"])
    lines = [f"| image | {' | '.join(names)} |", "|---|" + "---:|" * len(names)]
    for row in rows:
        cells = [f"{row['time_us'][one]:.0f} ({row['points'][one]})" for one in names]
        lines.append(f"| {row['image']} | {' | '.join(cells)} |")
    return (
        f"Least time of {REPEATS} turns of {BURST} runs each [us] and number of descriptors; each for the "
        "points of its own detector.\n\n" + in_file("\n".join(lines)) + "\n\n"
        f"The thesis on its three maps [us]: {_printed(thesis.DESCRIPTORS_US)}."
    )


def methods(rows: list[dict[str, Any]]) -> str:
    """Return what each method of matching finds."""
    if not rows:
        return "There are no positives with 30 % of overlap and more in this bank."
    lines = [
        "| method | matches | right ones | pairs with two right ones | best vote right | time [ms] |",
        "|---|---:|---:|---:|---:|---:|",
    ]
    lines += [
        f"| {row['method']} | {row['matches']:.0f} | {row['right']:.0f} | {100 * row['two_right']:.0f} % | "
        f"{100 * row['voted']:.0f} % | {row['time_ms']:.1f} |"
        for row in rows
    ]
    return (
        f"Medians over {rows[0]['pairs']} positives with 30 % of overlap and more.\n\n" + "\n".join(lines) + "\n\n"
        "The thesis [ms]: distances 3.0, triplets 1.5, descriptors 208 and 85; with descriptors two right matches in "
        "more than 85 % of its pairs."
    )


def teams(rows: list[dict[str, Any]]) -> str:
    """Return how five maps of a floor are joined."""
    lines = ["| floor | joined | largest error [m] | [deg] | time [s] |", "|---|---:|---:|---:|---:|"]
    for row in rows:
        figures_of_row = (f"{row['distance_m']:.3f}", f"{math.degrees(row['angle']):.2f}", f"{row['time_s']:.2f}")
        lines.append(f"| {row['floor']} | {row['joined']} of {row['robots']} | {' | '.join(figures_of_row)} |")
    whole = sum(row["joined"] == row["robots"] for row in rows)
    return (
        f"The last maps of five drives of a floor, merged at once: all joined on {whole} of {len(rows)} "
        "floors.\n\n" + in_file("\n".join(lines))
    )


def _printed(rows: Mapping[str, tuple[int, ...]]) -> str:
    return ", ".join(f"{name} {'/'.join(str(one) for one in times)}" for name, times in rows.items())
