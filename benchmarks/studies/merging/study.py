"""The study ``merging``: merging of robots' maps, besides the thesis and ROS map_merge."""

import json
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from lidarium.benchmarks.results_page import in_file
from lidarium.benchmarks.studies.merging import tables
from lidarium.benchmarks.studies.merging.bank.bank import BankMap, Pair, read_maps, read_pairs
from lidarium.benchmarks.studies.merging.bank.drives import RESOLUTION
from lidarium.benchmarks.studies.merging.bank.floors import bank_floors
from lidarium.benchmarks.studies.merging.bank.groups import merge_teams
from lidarium.benchmarks.studies.merging.bank.making import kept_floors, make_bank
from lidarium.benchmarks.studies.merging.features import compare_descriptors, compare_detectors, compare_methods
from lidarium.benchmarks.studies.merging.figures import Tried
from lidarium.benchmarks.studies.merging.plans import merge_plans, plan_tables
from lidarium.benchmarks.studies.merging.real_maps import merge_real_maps, real_maps
from lidarium.benchmarks.studies.merging.structure import FLOORS as STRUCTURE_FLOORS
from lidarium.benchmarks.studies.merging.structure import compare_structures, draw_regions, structure_text
from lidarium.benchmarks.studies.merging.thesis import (
    stages_text,
    thesis_stages,
    thesis_thresholds,
    thresholds_text,
    twelve_pairs,
    twelve_text,
)
from lidarium.benchmarks.studies.merging.trials import METHODS, Outcome, read_outcomes, try_pairs
from lidarium.benchmarks.studies.shared.study import Progress, Study
from lidarium.evaluation.processes import shared_out
from lidarium.mapping.files.output import whole_file, write_json
from lidarium.mapping.grids.occupancy import FREE, OCCUPIED
from lidarium.mapping.merging.fusion import FusedMap, fuse
from lidarium.mapping.merging.settings import STRUCTURES, MergeSettings, merge_settings

FIRST, SECOND, BOTH = (np.array(colour, np.float64) for colour in ((37, 99, 235), (234, 88, 12), (31, 41, 55)))


def draw_pairs(path: Path, maps: dict[str, BankMap], pairs: list[Pair], outcomes: list[Outcome]) -> None:
    """Draw five pairs of maps, overlaid as they truly lie.

    Two are joined, one is missed, one is a look-alike and one is symmetric.
    """
    chosen = _chosen(pairs, outcomes)
    figure = Figure(figsize=(3.4 * len(chosen), 4.4), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    for axes, (title, pair) in zip(figure.subplots(1, len(chosen), squeeze=False)[0], chosen, strict=True):
        _draw(axes, title, maps[pair.a], maps[pair.b])
    with whole_file(path) as beside:
        figure.savefig(beside, bbox_inches="tight", pad_inches=0.15)


def _chosen(pairs: list[Pair], outcomes: list[Outcome]) -> list[tuple[str, Pair]]:
    both = list(zip(pairs, outcomes, strict=True))
    wanted: tuple[tuple[str, Callable[[Pair, Outcome], bool]], ...] = (
        (
            "joined by corners",
            lambda pair, one: pair.category == "positive" and one.is_accepted and one.found_by == "corners",
        ),
        (
            "joined by correlation, little overlap",
            lambda pair, one: pair.category == "positive" and one.is_accepted and pair.overlap < 0.3,
        ),
        (
            "missed: little overlap",
            lambda pair, one: pair.category == "positive" and not one.is_accepted and pair.overlap < 0.3,
        ),
        ("look-alike, refused", lambda pair, one: pair.category == "look_alike" and not one.is_accepted),
        (
            "furniture taken away, joined",
            lambda pair, one: pair.category == "refurnished" and pair.differing_m > 2.0 and one.is_accepted,
        ),
        ("symmetric, refused", lambda pair, one: pair.category == "symmetric" and not one.is_accepted),
    )
    found = [(title, next((pair for pair, one in both if is_wanted(pair, one)), None)) for title, is_wanted in wanted]
    return [(title, pair) for title, pair in found if pair is not None] or [(pair.category, pair) for pair in pairs[:1]]


def _draw(axes: Axes, title: str, a: BankMap, b: BankMap) -> None:
    fused = fuse([a.levels, b.levels], [a.floor_from_map, b.floor_from_map], RESOLUTION)
    axes.imshow(_coloured(fused), origin="lower", interpolation="nearest")
    axes.set_title(title, fontsize=10)
    axes.set_xlabel(f"{a.key}\n{b.key}", fontsize=8)
    axes.set_xticks([])
    axes.set_yticks([])


def _coloured(fused: FusedMap) -> NDArray[np.uint8]:
    """Return walls and free space coloured by which map knows them. The shape is (rows, columns, 3)."""
    sources = fused.sources.astype(np.int64)
    picture = np.full((*sources.shape, 3), 240.0)
    for bits, colour in ((1, FIRST), (2, SECOND), (3, BOTH)):
        is_seen = sources == bits
        picture[is_seen & (fused.levels == FREE)] = 255.0 - 0.15 * (255.0 - colour)
        picture[is_seen & (fused.levels == OCCUPIED)] = colour
    return picture.astype(np.uint8)


FEW = 20
"""If every so many-th floor is taken or fewer, maps and plans of real buildings are left out."""

EXTRA_FILE = "extra.json"
EXTRA = ("detectors", "descriptors", "methods", "stages", "thresholds", "twelve", "teams", "structure", "real", "plans")
PROPOSED = tuple(structure for structure in STRUCTURES if structure != MergeSettings().structure)
"""Structures that are tried beside the default."""


def work(folder: Path, data: Path | None, every: int, workers: int) -> Progress:
    """Fill the bank and try everything on it.

    What is there is not done again. Yields what is being done, how much is, and of how much.
    """
    floors = bank_floors(data, every)
    yield from make_bank(folder, floors, workers, every)
    maps, pairs = read_maps(folder, floors), read_pairs(folder) or []
    tested = [pair for pair in pairs if pair.half == "test"]
    for method in METHODS:
        for done in try_pairs(folder / "outcomes", maps, tested, method, workers):
            yield f"pairs, {method}", done, len(tested)
    for structure in PROPOSED:
        settings = replace(merge_settings("default", RESOLUTION), structure=structure)
        for done in try_pairs(_proposed(folder, structure), maps, tested, "default", workers, settings):
            yield f"pairs, {structure}", done, len(tested)
    kept = folder / EXTRA_FILE
    extra: dict[str, Any] = json.loads(kept.read_text(encoding="utf-8")) if kept.exists() else {}
    missing = [name for name in EXTRA if name not in extra]
    for name, rows in shared_out(partial(_measured, folder, data, every), missing, 1, is_apart=True):
        if isinstance(rows, Exception):
            raise rows
        extra[name] = rows
        yield "other experiments", len(extra), len(EXTRA)
    if missing:
        write_json(kept, extra)


def _proposed(folder: Path, structure: str) -> Path:
    """Return the folder of what a structure says of the bank's pairs."""
    return folder / "structures" / structure


def _measured(folder: Path, data: Path | None, every: int, name: str) -> list[dict[str, Any]]:
    """Do one of the other experiments, on the maps of the test half."""
    maps = read_maps(folder, [floor for floor in kept_floors(folder) if floor.half == "test"])
    if name == "detectors":
        return compare_detectors(maps)
    if name == "descriptors":
        return compare_descriptors(maps)
    pairs = [pair for pair in read_pairs(folder) or [] if pair.half == "test"]
    if name == "methods":
        return compare_methods(maps, pairs)
    if name == "stages":
        return thesis_stages(maps, pairs)
    if name == "thresholds":
        return thesis_thresholds(maps, pairs)
    if name == "twelve":
        return twelve_pairs(maps)
    if name == "teams":
        return merge_teams(maps)
    if name == "structure":
        return compare_structures(data if every < FEW else None, max(STRUCTURE_FLOORS // every, 1))
    if data is None or every >= FEW:
        return []
    return merge_plans(data) if name == "plans" else merge_real_maps(data)


def page(folder: Path) -> str:
    """Return the results as markdown."""
    pairs = [pair for pair in read_pairs(folder) or [] if pair.half == "test"]
    tried: dict[str, Tried] = {
        method: list(zip(pairs, read_outcomes(folder / "outcomes", pairs, method), strict=True)) for method in METHODS
    }
    extra = json.loads((folder / EXTRA_FILE).read_text(encoding="utf-8"))
    parts = [
        "# Merging maps",
        "[Merging maps](../reference/merging.md) describes the method. Times are CPU times, medians on a shared "
        "machine.",
        _about_bank(folder, len(pairs)),
        "## The bank\n\n" + tables.bank_table(tried),
        tables.reading(tried),
        tables.peers(tried),
        "![Pairs of the bank: joined, refused, and a look-alike](merging_pairs.png)",
        "## By overlap and stage\n\n" + tables.by_stage(tried["default"]),
        "## Beside the thesis's bank\n\n" + tables.beside_thesis(tried),
        "## Why the thesis's rules join so little\n\n" + _about_thesis(extra),
        "## Detectors\n\n" + tables.detectors(extra["detectors"]),
        "## Descriptors\n\n" + tables.descriptors(extra["descriptors"]),
        "## Matching\n\n" + tables.methods(extra["methods"]),
        "## Five robots\n\n" + tables.teams(extra["teams"]),
    ]
    outcomes = {MergeSettings().structure: tried["default"]} | {
        structure: list(zip(pairs, read_outcomes(_proposed(folder, structure), pairs, "default"), strict=True))
        for structure in PROPOSED
    }
    parts.append("## Regions and doors\n\n" + structure_text(extra["structure"], outcomes))
    if extra["real"]:
        parts.append("## Maps of real robots\n\n" + real_maps(extra["real"]))
    if extra["plans"]:
        parts.append("## Drawn plans\n\n" + plan_tables(extra["plans"]))
    return "\n\n".join(parts) + "\n"


def _about_thesis(extra: dict[str, Any]) -> str:
    """Return what the thesis's stages find here, and its table of pairs of one apartment."""
    return (
        "Stage by stage on positives with 30 % of overlap and more, in thesis mode, beside the truth:\n\n"
        + stages_text(extra["stages"])
        + "\n\nThe detector compares cell for cell. With 3 cm of noise, walls of 2.5 cm cells become ragged, so "
        "corners of one map are seldom in the other, and discs agree too little even at the true transform, where "
        "unknown cells count as a state. The thesis's own four joins were within 1.1 % of the bound (90.2 to 91.1 "
        "%).\n\nThe thesis prints neither the threshold of its descriptors nor its measure; the mode `thesis` has 0.80 "
        "of a normalised correlation. Six choices, on some of these positives, join at most "
        f"{_most_joined(extra['thresholds'], 'clean')} *clean* pairs (cells of the floor itself, as far as each map "
        f"knows them) and {_most_joined(extra['thresholds'], 'bank')} of this bank right, within 0.5 m and 5 degrees. "
        "The thesis had 10 to 126 initial matches a pair.\n\n" + in_file(thresholds_text(extra["thresholds"])) + "\n\n"
        "The thesis's table of twelve pairs for the first apartment of this bank (first and last map of a drive from "
        "each start), beside its printed figures:\n\n" + in_file(twelve_text(extra["twelve"]))
    )


def _most_joined(rows: Sequence[dict[str, Any]], maps: str) -> str:
    """Return how many pairs the best threshold and measure join right."""
    joined, pairs = max((row["joined"], row["pairs"]) for row in rows if row["maps"] == maps)
    return f"{joined} of {pairs}"


def pictures(folder: Path, out: Path) -> None:
    """Draw pairs of the bank, and regions of a corridor, besides the page."""
    draw_regions(out / "merging_regions.png")
    floors = kept_floors(folder)
    pairs = [pair for pair in read_pairs(folder) or [] if pair.half == "test"]
    draw_pairs(
        out / "merging_pairs.png",
        read_maps(folder, floors),
        pairs,
        read_outcomes(folder / "outcomes", pairs, "default"),
    )


def _about_bank(folder: Path, tested: int) -> str:
    floors = kept_floors(folder)
    copies = sum(floor.is_copy for floor in floors)
    counts = Counter(pair.category for pair in read_pairs(folder) or [])
    return (
        f"Robots explore {len(floors) - copies} floors (generated, drawn and real ones) and {copies} copies with "
        "furniture removed, from three starts, twice from each (copies once). Maps are kept at a third, two thirds and "
        "95 % of a floor (12, 35 and 90 % in buildings of like rooms). The laser has 3 cm of noise; poses have smooth "
        "errors of up to 4 cm and 0.3 degrees. The pairs, of robots from different starts, in both halves:\n\n"
        f"- {counts['positive']} positives: one floor, at least 15 % of overlap.\n"
        f"- {counts['negative']} negatives: different floors.\n"
        f"- {counts['refurnished']} refurnished: a floor and its copy, the same place too.\n"
        f"- {counts['look_alike']} look-alikes: like rooms of one building that differ by at least 1 m of wall in "
        "every overlay; negatives too.\n"
        f"- Undecidable, in no rate: {counts['symmetric']} symmetric positives, which another transform explains as "
        f"well, and {counts['indistinct']} indistinct negatives, which differ by less than 1 m. A refusal is right.\n\n"
        f"One half of the floors was for tuning; all figures are of the other half, {tested} pairs, which was drawn "
        "anew after two former ones had been looked at. When bends were added, 2 of its pairs were wrongly joined, and "
        "three bounds were set on them. A positive counts as recalled if it is joined within 0.10 m and 1 degree at "
        "the overlap's centroid. Intervals are Clopper and Pearson's, 95 %."
    )


STUDY = Study(page, work=work, pictures=pictures)
