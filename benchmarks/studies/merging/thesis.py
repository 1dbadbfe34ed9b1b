"""The method of the thesis, stage by stage, and its published figures."""

import math
import time
from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations, product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.benchmarks.studies.merging.bank.bank import BankMap, Pair
from lidarium.benchmarks.studies.merging.bank.drives import RESOLUTION
from lidarium.benchmarks.studies.merging.bank.pairs import PLENTY, true_levels
from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.grids.occupancy import UNKNOWN
from lidarium.mapping.merging.agreement import compare, disc_agreement
from lidarium.mapping.merging.correspondence import MEASURES, match_corners
from lidarium.mapping.merging.described_map import DescribedMap
from lidarium.mapping.merging.pair import described, merge_pair
from lidarium.mapping.merging.settings import MergeSettings, merge_settings


class PrintedPair(NamedTuple):
    """A pair of the thesis's bank, as printed.

    It has names of the maps, matches, RANSAC inliers, agreement in discs [%], time [us], and whether it
    was accepted.
    """

    a: str
    b: str
    matches: int
    inliers: int
    agreement: float
    time_us: int
    is_accepted: bool


PAIRS = (
    PrintedPair("B1", "C1", 10, 0, 0.0, 27319, False),
    PrintedPair("B1", "C2", 21, 5, 90.161, 152583, True),
    PrintedPair("B1", "A1", 15, 3, 77.420, 94425, False),
    PrintedPair("B1", "A2", 49, 3, 84.519, 179721, False),
    PrintedPair("C1", "A1", 27, 7, 55.841, 21912, False),
    PrintedPair("C1", "A2", 38, 5, 90.314, 43468, True),
    PrintedPair("C1", "B2", 42, 4, 73.741, 33754, False),
    PrintedPair("A1", "B2", 27, 6, 91.054, 114585, True),
    PrintedPair("A1", "C2", 35, 5, 82.417, 125171, False),
    PrintedPair("B2", "C2", 58, 4, 68.106, 194303, False),
    PrintedPair("B2", "A2", 126, 6, 74.941, 193064, False),
    PrintedPair("C2", "A2", 52, 9, 90.170, 247168, True),
)
"""All of them; 10 overlap in truth, it does not say which."""

OVERLAPPING = 10

DETECTION_US = {"A1": 1731, "A2": 1523, "B1": 3101, "B2": 4852, "C1": 827, "C2": 2914}
DESCRIPTION_US = {"A1": 11171, "A2": 24335, "B1": 15320, "B2": 17891, "C1": 3004, "C2": 26048}
"""Times of each map [us]."""

DETECTORS_US = {
    "own": (384, 228, 2349),
    "Shi-Tomasi": (1095, 632, 9106),
    "Trajkovic and Hedley": (1393, 625, 15524),
    "SIFT": (11321, 6510, 75746),
}
"""Times on three maps of 146 x 144, 113 x 113 and 398 x 402 cells [us].

The row of Shi-Tomasi may be that of Harris, copied.
"""

DESCRIPTORS_US = {
    "polar": (904, 425, 1808),
    "log-polar": (829, 605, 1050),
    "SIFT": (9176, 5407, 61673),
    "ORB": (1164, 315, 8704),
}
"""The same of descriptors [us]."""


def pair_ms(pair: PrintedPair) -> float:
    """Return the time of a pair [ms]. Detection and description of both of its maps are included."""
    return (pair.time_us + sum(DETECTION_US[name] + DESCRIPTION_US[name] for name in (pair.a, pair.b))) / 1e3


def claimed_ms() -> float:
    """Return the sum claimed as the most that a pair takes [ms]. It is the longest time of each stage, once."""
    return (max(DETECTION_US.values()) + max(DESCRIPTION_US.values()) + max(pair.time_us for pair in PAIRS)) / 1e3


THRESHOLDS = (0.80, 0.60, 0.40)
"""Similarities from which corners match; the thesis prints none, the first is that of the mode ``thesis``."""

JOINED_M, JOINED_ANGLE = 0.5, math.radians(5.0)
MOST_PAIRS, MOST_ROWS = 40, 12
SAME_CELLS, RIGHT_M = 2.0, 0.15
"""Distance of corners that are one in two maps [cells], and of matches that are right [m]."""


def _positives(pairs: Sequence[Pair]) -> tuple[list[Pair], list[Pair]]:
    """Return the positives of 30 % of overlap and more, and some of them."""
    chosen = [pair for pair in pairs if pair.category == "positive" and pair.overlap >= PLENTY]
    return chosen, chosen[:: max(len(chosen) // MOST_PAIRS, 1)][:MOST_PAIRS]


def thesis_thresholds(maps: dict[str, BankMap], pairs: Sequence[Pair]) -> list[dict[str, Any]]:
    """Return what the thesis's rules make of positives by thresholds and measures, on clean maps and on the bank's."""
    base, rows = merge_settings("thesis", RESOLUTION), []
    for kind in ("clean", "bank"):
        known: dict[str, DescribedMap] = {}
        tried = []
        for pair in _positives(pairs)[1]:
            for key in {pair.a, pair.b} - set(known):
                levels = true_levels(maps[key]) if kind == "clean" else maps[key].levels
                known[key] = described(levels, RESOLUTION, base)
            true = Transform() if kind == "clean" else pair.a_from_b
            assert true is not None
            tried.append((known[pair.a], known[pair.b], true))
        for measure, threshold in product(MEASURES, THRESHOLDS):
            chosen = replace(base.correspondence, measure=measure, threshold=threshold)
            found = [_tried(*one, replace(base, correspondence=chosen)) for one in tried]
            matches, right, joined, wrong = np.array(found, np.int64).reshape(-1, 4).T
            rows.append(
                {
                    "maps": kind,
                    "measure": measure,
                    "threshold": threshold,
                    "pairs": len(found),
                    "matches": np.quantile(matches, (0.0, 0.5, 1.0)).tolist() if found else [0.0] * 3,
                    "three_right": int(np.count_nonzero(right >= base.alignment.least_inliers)),
                    "joined": int(joined.sum()),
                    "wrong": int(wrong.sum()),
                }
            )
    return rows


def _tried(a: DescribedMap, b: DescribedMap, true: Transform, settings: MergeSettings) -> tuple[int, int, bool, bool]:
    """Return the number of matches and of right ones, and whether a pair is joined right, and wrong."""
    matches = match_corners(a.corners, b.corners, a.descriptors, b.descriptors, settings.correspondence)
    apart = np.linalg.norm(true.apply(b.corners.points[matches.second]) - a.corners.points[matches.first], axis=1)
    found = merge_pair(a, b, settings)
    if not found.is_accepted or found.a_from_b is None:
        return len(matches), int(np.count_nonzero(apart <= RIGHT_M)), False, False
    distance, angle = found.a_from_b.difference(true, found.agreement.centre)
    is_right = distance <= JOINED_M and angle <= JOINED_ANGLE
    return len(matches), int(np.count_nonzero(apart <= RIGHT_M)), is_right, not is_right


def thresholds_text(rows: Sequence[dict[str, Any]]) -> str:
    """Return the table of thresholds, as markdown."""
    lines = [
        "| maps | measure | threshold | matches: least, median, most | pairs with three right ones | joined right | "
        "joined wrong |",
        "|---|---|---:|---:|---:|---:|---:|",
    ]
    for row in rows:
        least, median, most = row["matches"]
        lines.append(
            f"| {row['maps']} | {row['measure']} | {row['threshold']:.2f} | {least:.0f}, {median:.0f}, {most:.0f} | "
            f"{row['three_right']} of {row['pairs']} | {row['joined']} | {row['wrong']} |"
        )
    return "\n".join(lines)


def thesis_stages(maps: dict[str, BankMap], pairs: Sequence[Pair]) -> list[dict[str, Any]]:
    """Return what each stage of the thesis's rules makes of positives."""
    chosen, some = _positives(pairs)
    settings = merge_settings("thesis", RESOLUTION)
    known: dict[str, DescribedMap] = {}
    for pair in some:
        for key in (pair.a, pair.b):
            known.setdefault(key, described(maps[key].levels, RESOLUTION, settings))
    return [_stages(pair, known[pair.a], known[pair.b]) for pair in chosen if {pair.a, pair.b} <= set(known)]


def _stages(pair: Pair, a: DescribedMap, b: DescribedMap) -> dict[str, Any]:
    """Return the figures of one pair."""
    settings, true = merge_settings("thesis", RESOLUTION), pair.a_from_b
    assert true is not None
    apart = np.linalg.norm(true.apply(b.corners.points)[:, None] - a.corners.points[None], axis=2)
    matches = match_corners(a.corners, b.corners, a.descriptors, b.descriptors, settings.correspondence)
    return {
        "corners": 0.5 * (len(a.corners) + len(b.corners)),
        "repeated": _share(apart.min(axis=1, initial=math.inf) <= SAME_CELLS * RESOLUTION),
        "matches": len(matches),
        "right": int(np.count_nonzero(apart[matches.second, matches.first] <= RIGHT_M)),
        "discs_at_truth": disc_agreement(a, b, true, b.corners.points, settings.validation.disc_radius_cells),
        "is_joined": merge_pair(a, b, settings).is_accepted,
    }


def _share(flags: NDArray[np.bool_]) -> float:
    return float(flags.mean()) if len(flags) else 0.0


def twelve_pairs(maps: dict[str, BankMap]) -> list[dict[str, Any]]:
    """Return the table of the thesis for the first apartment: pairs of robots from different starts.

    Of each start the first and the last map are taken, A1 and A2 and so on.
    """
    apartments = sorted(key for key in maps if key.startswith("apartment-") and key.endswith(("_0_0", "_0_2")))
    first = next((key.split("_")[0] for key in apartments), "")
    names = {
        key: f"{'ABC'[maps[key].start]}{1 + (maps[key].stage == 2)}" for key in apartments if key.split("_")[0] == first
    }
    settings = merge_settings("thesis", RESOLUTION)
    rows: list[dict[str, Any]] = []
    for a, b in combinations(names, 2):
        if maps[a].start == maps[b].start or len(rows) == MOST_ROWS:
            continue
        began = time.process_time()
        one, other = (described(maps[key].levels, RESOLUTION, settings) for key in (a, b))
        found = merge_pair(one, other, settings)
        spent = time.process_time() - began
        true = maps[a].floor_from_map.inverse() @ maps[b].floor_from_map
        common_m2 = compare(one, other, true, settings.validation).overlap_m2
        least = min(int(np.count_nonzero(maps[key].levels != UNKNOWN)) for key in (a, b))
        rows.append(
            {
                "pair": f"{names[a]}-{names[b]}",
                "overlap": min(common_m2 / (least * RESOLUTION**2), 1.0),
                "matches": found.matches,
                "inliers": found.inliers,
                "agreement": 100.0 * found.score,
                "time_us": 1e6 * spent,
                "is_accepted": found.is_accepted,
                "error_m": None
                if found.a_from_b is None
                else found.a_from_b.difference(true, found.agreement.centre)[0],
            }
        )
    return rows


def stages_text(rows: Sequence[dict[str, Any]]) -> str:
    """Return what the stages say, as markdown."""
    if not rows:
        return "There are no positives with 30 % of overlap and more in this bank."

    def median(name: str) -> float:
        return float(np.median([row[name] for row in rows]))

    three = sum(row["right"] >= 3 for row in rows)
    agree = sum(row["discs_at_truth"] > 0.9 for row in rows)
    lines = [
        "| stage | this bank, median | what it needs |",
        "|---|---:|---|",
        f"| corners of a map | {median('corners'):.0f} | |",
        f"| of these in the other map too, within 2 cells | {100 * median('repeated'):.0f} % | |",
        f"| matches | {median('matches'):.0f} | |",
        f"| right matches | {median('right'):.0f} | 3; {three} of {len(rows)} pairs have them |",
        f"| agreement in the discs, at the true transform | {100 * median('discs_at_truth'):.0f} % | 90 %; "
        f"{agree} of {len(rows)} pairs reach it |",
        f"| joined | {sum(row['is_joined'] for row in rows)} of {len(rows)} | |",
    ]
    return "\n".join(lines)


def twelve_text(rows: Sequence[dict[str, Any]]) -> str:
    """Return the table of twelve pairs, as markdown."""
    lines = [
        "| pair | known in both | initial matches | inliers | overlap [%] | time [us] | accepted | error [m] | "
        "printed: initial matches | inliers | overlap [%] | time [us] | accepted |",
        "|---|---:|---:|---:|---:|---:|---|---:|---:|---:|---:|---:|---|",
    ]
    printed = {"-".join(sorted((pair.a, pair.b))): pair for pair in PAIRS}
    for row in rows:
        overlap = f"{100 * row['overlap']:.0f} %"
        error = "-" if row["error_m"] is None else f"{row['error_m']:.2f}"
        theirs = printed[row["pair"]]
        lines.append(
            f"| {row['pair']} | {overlap} | {row['matches']} | {row['inliers']} | {row['agreement']:.3f} | "
            f"{row['time_us']:.0f} | {_yes(row['is_accepted'])} | {error} | {theirs.matches} | {theirs.inliers} | "
            f"{theirs.agreement:.3f} | {theirs.time_us} | {_yes(theirs.is_accepted)} |"
        )
    return "\n".join(lines)


def _yes(is_so: bool) -> str:
    return "yes" if is_so else "no"
