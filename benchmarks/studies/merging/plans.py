"""Maps of robots laid on drawn plans of which nobody knows the scale, and strangers at every scale."""

import gzip
import itertools
import json
import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from lidarium.benchmarks.results_page import in_file
from lidarium.benchmarks.studies.merging.figures import Share
from lidarium.benchmarks.studies.merging.real_maps import HALMSTAD_M, RIGHT_ANGLE, RIGHT_M, Grid, single_maps
from lidarium.mapping.files.map_files import read_grey_map
from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.merging.pair import PairResult
from lidarium.mapping.merging.scaling import ScaleSettings, merge_scaled
from lidarium.mapping.merging.settings import MergeSettings

THRESHOLDS = (0.5, 0.8, 0.9, 0.95, 0.98, 0.99)
"""Confidences of the curve."""

EVERY = 3
"""Of the pairs of maps of different buildings one in so many is tried."""

STRUCTURE = "all"
"""What proposes placements: that of `lidarium merge`."""

Rows = list[dict[str, Any]]


@dataclass(frozen=True, slots=True)
class PlanRow:
    """What the merger says of a pair of unlike scales.

    `pair`, `building`: names of the maps, and the building of which both are; ``strangers`` for maps of two buildings;
    `is_accepted`, `is_right`: whether it is joined, and whether the best transform is right; strangers have no right
    one; `distance_m`, `angle`: error of the best transform at the median correspondence [m, rad]; `scale`,
    `true_scale`: by how much the second map grows, and should by its correspondences; `confidence`, `time_ms`: of the
    best hypothesis, and processor time [ms].
    """

    pair: str
    building: str
    is_accepted: bool
    is_right: bool
    distance_m: float | None
    angle: float | None
    scale: float
    true_scale: float | None
    confidence: float
    time_ms: float


def merge_plans(data: Path) -> Rows:
    """Lay all sensor maps below a folder on plans, and strangers on each other; none if it has none."""
    cv2.setNumThreads(1)
    folder = Path(data) / "map_pairs" / "halmstad"
    if not (folder / "ground_truth.json.gz").is_file():
        return []
    return [asdict(row) for row in itertools.chain(_plans(folder), _strangers(Path(data), folder))]


def similarity_error(
    truth: dict[str, Any], rows: tuple[int, int], scale: float, plan_from_sensor: Transform
) -> tuple[float, float]:
    """Return the median distance of correspondences under a similarity, and its error of rotation [m, rad].

    Correspondences are pixels whose y runs down, of the plan (``dst_pts``) and the sensor map (``src_pts``).
    """
    plan, sensor = (
        np.column_stack([points[:, 0], count - points[:, 1]]) * HALMSTAD_M
        for points, count in zip((np.array(truth["dst_pts"]), np.array(truth["src_pts"])), rows, strict=True)
    )
    gaps = np.linalg.norm(plan_from_sensor.apply(sensor * scale) - plan, axis=1)
    turn = math.remainder(plan_from_sensor.theta + math.radians(truth["theta_deg"]), 2.0 * math.pi)
    return float(np.median(gaps)), abs(turn)


def _plans(folder: Path) -> Iterator[PlanRow]:
    """Yield each sensor map of a building with its plan."""
    truths = json.loads(gzip.decompress((folder / "ground_truth.json.gz").read_bytes()))
    for name, truth in truths.items():
        if not name.endswith("layout"):
            continue
        sensor, plan = (_read(folder, one) for one in name.split("__"))
        result, scale = _merged(plan, sensor)
        rows = (len(plan.levels), len(sensor.levels))
        error = None
        if result.a_from_b is not None:
            error = similarity_error(truth, rows, scale, result.a_from_b)
        yield _row((name, name.split("_")[0]), (result, scale), error, round(float(truth["scale"]), 4))


def _strangers(data: Path, folder: Path) -> Iterator[PlanRow]:
    """Yield plans with maps of other buildings, and every third pair of maps of different buildings."""
    plans = [
        (path.stem, path.stem.split("_")[0], _read(folder, path.stem)) for path in sorted(folder.glob("*_layout.png"))
    ]
    maps = list(single_maps(data))
    pairs = itertools.chain(
        itertools.product(maps, plans), itertools.islice(itertools.combinations(maps, 2), 0, None, EVERY)
    )
    for (a, building, grid), (b, other_building, other) in pairs:
        if building != other_building:
            yield _row((f"{a}, {b}", "strangers"), _merged(grid, other), None, None)


def _row(
    names: tuple[str, str], found: tuple[PairResult, float], error: tuple[float, float] | None, true_scale: float | None
) -> PlanRow:
    """Return what is kept of a pair, by its name and building."""
    result, scale = found
    distance_m, angle = (None, None) if error is None else error
    return PlanRow(
        names[0],
        names[1],
        result.is_accepted,
        error is not None and error[0] < RIGHT_M and error[1] < RIGHT_ANGLE,
        distance_m,
        angle,
        round(scale, 4),
        true_scale,
        round(result.confidence, 4),
        round(result.time_ms, 1),
    )


def _read(folder: Path, name: str) -> Grid:
    return Grid(read_grey_map(folder / f"{name}.png", HALMSTAD_M).levels, HALMSTAD_M)


def _merged(a: Grid, b: Grid) -> tuple[PairResult, float]:
    """Return what comes of two maps, and by how much the second grows."""
    scaled = merge_scaled({"a": a, "b": b}, MergeSettings(structure=STRUCTURE))
    (result,) = scaled.merged.pairs.values()
    return result, scaled.scale


def plan_tables(rows: Rows) -> str:
    """Return how sensor maps are joined with drawn plans of unknown scale."""
    settings = ScaleSettings()
    lines = ["| maps | pairs | right and joined | wrong and joined | time, median / 95 % [ms] |"]
    lines.append("|---|---:|---|---|---:|")
    for building in dict.fromkeys(row["building"] for row in rows):
        own = [row for row in rows if row["building"] == building]
        joined = [row for row in own if row["is_accepted"]]
        right = Share(sum(row["is_right"] for row in joined), len(own))
        wrong = Share(sum(not row["is_right"] for row in joined), len(own))
        times = [row["time_ms"] for row in own]
        shown = "-" if building == "strangers" else str(right)
        spent = f"{np.median(times):.0f} / {np.quantile(times, 0.95):.0f}"
        lines.append(f"| `{building}` | {len(own)} | {shown} | {wrong} | {spent} |")
    return (
        f"Robots' maps on drawn plans of unknown scale (`--scale auto`, {settings.least:g} to {settings.most:g}). A "
        "pair is right within 1 m and 8 degrees at the median correspondence, with plan pixels of 2 cm. Strangers are "
        "plans with all maps of other buildings, and every third pair of maps of different buildings. The bound of "
        f"{settings.confidence:g} was set when all plans and 50 strangers had been seen.\n\n"
        + "\n".join(lines)
        + "\n\nThe same by the confidence from which maps are joined:\n\n"
        + in_file(_curve(rows))
        + "\n\nEach pair of one building:\n\n"
        + in_file(_each(rows))
    )


def _curve(rows: Rows) -> str:
    known = [row for row in rows if row["building"] != "strangers"]
    strangers = [row for row in rows if row["building"] == "strangers"]
    lines = ["| confidence | right | wrong | strangers |", "|---|---|---|---|"]
    for threshold in THRESHOLDS:
        right = sum(row["confidence"] >= threshold and row["is_right"] for row in known)
        wrong = sum(row["confidence"] >= threshold and not row["is_right"] for row in known)
        false = sum(row["confidence"] >= threshold for row in strangers)
        shares = (Share(right, len(known)), Share(wrong, len(known)), Share(false, len(strangers)))
        lines.append(f"| {threshold:g} | {' | '.join(str(share) for share in shares)} |")
    return "\n".join(lines)


def _each(rows: Rows) -> str:
    lines = [
        "| pair | result | confidence | error [m] | [deg] | scale | by correspondences |",
        "|---|---|---:|---:|---:|---:|---:|",
    ]
    for row in rows:
        if row["building"] == "strangers":
            continue
        error = ("-", "-")
        if row["distance_m"] is not None:
            error = (f"{row['distance_m']:.2f}", f"{np.degrees(row['angle']):.1f}")
        result = "joined" if row["is_accepted"] else "refused"
        lines.append(
            f"| {row['pair']} | {result} | {row['confidence']:.2f} | {error[0]} | {error[1]} | "
            f"{row['scale']:.3f} | {row['true_scale']:.3f} |"
        )
    return "\n".join(lines)
