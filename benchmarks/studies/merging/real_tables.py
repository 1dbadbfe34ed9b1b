"""Tables of the pairs of real maps: by building, the curve of recall against wrong ones, each pair."""

from collections.abc import Callable
from typing import Any

import numpy as np

from lidarium.benchmarks.studies.merging.figures import Share
from lidarium.mapping.merging.settings import TOLERANCES

Rows = list[dict[str, Any]]

THRESHOLDS = (0.3, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.99)
"""Confidences of the curve."""


def real_maps(rows: Rows) -> str:
    """Return how maps that others made of real buildings are joined."""
    groups = list(dict.fromkeys(_group(row) for row in rows))
    lines = [
        "| maps | fitted to | pairs | right and joined | wrong and joined | bend, median [m] | "
        "time, median / 95 % [ms] |",
        "|---|---|---:|---|---|---:|---:|",
    ]
    for group in groups:
        chosen = [row for row in rows if _group(row) == group]
        lines.append(f"| {_name(group)} | {'yes' if group[1] else 'no'} | {_figures(chosen, group[0])} |")
    return (
        "Maps that others made of real buildings. A pair of Halmstad is right within 1 m at the median "
        "correspondence and 8 degrees, as these maps are bent by up to 0.5 m; of the others within 0.5 m and "
        "3 degrees. Strangers are all pairs of maps of different buildings. The model was fitted to E5, the "
        "easy halves of logs, every other pair of strangers, and the bank's half for tuning.\n\n"
        + "\n".join(lines)
        + "\n\nThe same by the confidence from which maps are joined that agree only once they are bent "
        f"(`normal` is {TOLERANCES['normal']}, `drift` {TOLERANCES['drift']}):\n\n"
        + _curve(rows)
        + "\n\nEach pair of one building that is not joined, or wrong:\n\n"
        + _missed(rows)
    )


def _group(row: dict[str, Any]) -> tuple[str, bool]:
    building = row["pair"].split("_")[0] if row["collection"] == "halmstad" else ""
    return f"{row['collection']} {building}".strip(), row["is_tuned"]


def _name(group: tuple[str, bool]) -> str:
    return f"`{group[0]}`"


def _figures(rows: Rows, name: str) -> str:
    count = len(rows)
    joined = [row for row in rows if row["is_accepted"]]
    right = Share(sum(row["is_right"] for row in joined), count)
    wrong = Share(sum(not row["is_right"] for row in joined), count)
    times = [row["time_ms"] for row in rows]
    bends = [row["bend_m"] for row in joined]
    bend = f"{np.median(bends):.2f}" if bends else "-"
    share = "-" if name == "strangers" else str(right)
    return f"{count} | {share} | {wrong} | {bend} | {np.median(times):.0f} / {np.quantile(times, 0.95):.0f}"


def _curve(rows: Rows) -> str:
    """Return the curve: with each threshold what would be joined."""
    lines = [
        "| confidence | right of one building | wrong of one building | strangers |",
        "|---|---|---|---|",
    ]
    known = [row for row in rows if row["collection"] != "strangers"]
    strangers = [row for row in rows if row["collection"] == "strangers"]
    for threshold in THRESHOLDS:
        is_joined = _joined_from(threshold)
        right = Share(sum(is_joined(row) and row["is_right"] for row in known), len(known))
        wrong = Share(sum(is_joined(row) and not row["is_right"] for row in known), len(known))
        false = Share(sum(is_joined(row) for row in strangers), len(strangers))
        lines.append(f"| {threshold:g} | {right} | {wrong} | {false} |")
    return "\n".join(lines)


def _joined_from(threshold: float) -> Callable[[dict[str, Any]], bool]:
    """Return whether a pair is joined with a threshold: rigid ones whatever it is."""

    def is_joined(row: dict[str, Any]) -> bool:
        is_rigid = row["is_accepted"] and row["found_by"] != "bend"
        return bool(is_rigid or row["confidence"] >= threshold)

    return is_joined


def _missed(rows: Rows) -> str:
    lines = [
        "| pair | collection | result | confidence | error of the best [m] | [deg] |",
        "|---|---|---|---:|---:|---:|",
    ]
    for row in rows:
        if row["collection"] == "strangers" or (row["is_accepted"] and row["is_right"]):
            continue
        error = ("-", "-")
        if row["distance_m"] is not None:
            error = (f"{row['distance_m']:.2f}", f"{np.degrees(row['angle']):.1f}")
        result = "joined" if row["is_accepted"] else row["reason"].split(";")[-1].strip().split(":")[0]
        lines.append(
            f"| {row['pair']} | {row['collection']} | {result} | {row['confidence']:.2f} | {error[0]} | "
            f"{error[1]} |"
        )
    return "\n".join(lines)
