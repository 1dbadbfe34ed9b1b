"""Why the thesis's rules join so little of the bank: each stage on its own, beside the truth.

Its table 5-3 of twelve pairs is made again too, of one apartment, with the errors that it does not print.
"""

import math
import time
from collections.abc import Sequence
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.benchmarks.studies.merging.bank.bank import BankMap, Pair
from lidarium.benchmarks.studies.merging.bank.drives import RESOLUTION
from lidarium.benchmarks.studies.merging.bank.pairs import PLENTY
from lidarium.mapping.grids.occupancy import UNKNOWN
from lidarium.mapping.merging.agreement.counts import disc_agreement
from lidarium.mapping.merging.agreement.validation import compare
from lidarium.mapping.merging.correspondence import match_corners
from lidarium.mapping.merging.description.described_map import DescribedMap
from lidarium.mapping.merging.pair import described, merge_pair
from lidarium.mapping.merging.settings import merge_settings

MOST_PAIRS, MOST_ROWS = 40, 12
SAME_CELLS, RIGHT_M = 2.0, 0.15
"""Distance of corners that are one in two maps [cells], and of matches that are right [m]."""


def thesis_stages(maps: dict[str, BankMap], pairs: Sequence[Pair]) -> list[dict[str, Any]]:
    """Return what each stage of the thesis's rules makes of positives.

    Parameters
    ----------
    maps : dict of str to BankMap
        The bank.
    pairs : sequence of Pair
        Of which the positives with much overlap are examined, evenly spread.
    """
    chosen = [pair for pair in pairs if pair.category == "positive" and pair.overlap >= PLENTY]
    settings = merge_settings("thesis", RESOLUTION)
    known: dict[str, DescribedMap] = {}
    for pair in chosen[:: max(len(chosen) // MOST_PAIRS, 1)][:MOST_PAIRS]:
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
    apartments = sorted(
        key for key in maps if key.startswith("apartment-") and key.endswith(("_0_0", "_0_2"))
    )
    first = next((key.split("_")[0] for key in apartments), "")
    names = {
        key: f"{'ABC'[maps[key].start]}{1 + (maps[key].stage == 2)}"
        for key in apartments
        if key.split("_")[0] == first
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
        "| pair | known in both | initial matches | inliers | overlap [%] | time [us] | accepted | "
        "error [m] |",
        "|---|---:|---:|---:|---:|---:|---|---:|",
    ]
    for row in rows:
        overlap = f"{100 * row['overlap']:.0f} %"
        error = "-" if row["error_m"] is None else f"{row['error_m']:.2f}"
        lines.append(
            f"| {row['pair']} | {overlap} | {row['matches']} | {row['inliers']} | {row['agreement']:.3f} | "
            f"{row['time_us']:.0f} | {'yes' if row['is_accepted'] else 'no'} | {error} |"
        )
    return "\n".join(lines)
