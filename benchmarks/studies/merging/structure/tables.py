"""The section of the page on corners beside regions, and its picture."""

from pathlib import Path
from typing import Any

import numpy as np

from lidarium.benchmarks.studies.merging.figures import Share, Tried
from lidarium.benchmarks.studies.merging.structure.drawn_floors import SIDE_M, drawn_floor, seen_by
from lidarium.evaluation.drawing.maps.region_picture import RegionMap, save_region_picture
from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.merging.regions.graph import find_regions
from lidarium.mapping.merging.regions.settings import RegionSettings

Rows = list[dict[str, Any]]


def structure_text(rows: Rows, bank: dict[str, Tried]) -> str:
    """Return how many pairs each structure joins.

    Parameters
    ----------
    rows : list of dict
        A `StructureRow` of each collection and structure.
    bank : dict of str to Tried
        The bank's pairs by structure.
    """
    lines = ["| pairs | structure | number | joined right | joined wrong | time, median / 95 % [ms] |"]
    lines.append("|---|---|---:|---|---|---:|")
    lines += [_bank_line(name, structure, tried) for name in _BANK for structure, tried in bank.items()]
    lines += [
        f"| {row['collection']} | `{row['structure']}` | {row['pairs']} | "
        f"{'-' if 'strangers' in row['collection'] else Share(row['right'], row['pairs'])} | "
        f"{Share(row['wrong'], row['pairs'])} | {row['median_ms']:.0f} / {row['most_ms']:.0f} |"
        for row in rows
    ]
    return (
        "What proposes transforms before all rotations and translations are tried: corners (the default from "
        "Python and in teams), regions of free space and the doors between them, or both (`lidarium merge`). "
        "Halls have slanted walls and pillars, corridors rooms on both sides; both are drawn from seeds, and "
        "two robots see about two thirds of each from nine places. Strangers are each floor and the next. "
        "Times of the bank and of real maps include the description of both maps.\n\n"
        + "\n".join(lines)
        + "\n\nDrawn corridors are much alike: a door every few metres, nothing else. Bent by up to 0.6 m, "
        "some strangers among them fit, whatever proposes; `--tolerance strict` joins none that has to be "
        "bent. What regions propose and is refused is therefore not bent."
        "\n\n![Regions and doors of a drawn corridor and of what a robot has seen of it](merging_regions.png)"
    )


_BANK = ("positive", "refurnished", "negative")


def _bank_line(category: str, structure: str, tried: Tried) -> str:
    """Return the line of the bank's pairs of a category; look-alikes are negatives."""
    kinds = ("negative", "look_alike") if category == "negative" else (category,)
    chosen = [(pair, one) for pair, one in tried if pair.category in kinds]
    right = sum(one.is_accepted and one.is_exact for _, one in chosen)
    wrong = sum(one.is_accepted and not one.is_exact for _, one in chosen)
    times = [one.time_ms for _, one in chosen] or [0.0]
    shown = "-" if category == "negative" else str(Share(right, len(chosen)))
    return (
        f"| bank, {category} | `{structure}` | {len(chosen)} | {shown} | {Share(wrong, len(chosen))} | "
        f"{np.median(times):.0f} / {np.quantile(times, 0.95):.0f} |"
    )


def draw_regions(path: Path) -> None:
    """Draw the regions of a drawn corridor, and of what a robot has seen of it."""
    floor = drawn_floor("corridor", 1)
    view = seen_by(floor, (0.0, 0.7), Transform(3.0, 5.0, 0.3), (1, 1))
    maps = {}
    for name, levels in (("plan", floor), ("seen", view.levels)):
        graph = find_regions(levels, SIDE_M, RegionSettings())
        maps[name] = RegionMap(levels, SIDE_M, graph, Transform())
    save_region_picture(path, maps)
