"""Merging of real maps that overlap, and its tables."""

import gzip
import itertools
import json
import math
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from lidarium.benchmarks.results_page import in_file
from lidarium.benchmarks.studies.merging.figures import Share
from lidarium.mapping.files.map_files import read_grey_map, read_ros_map
from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.merging.described_map import resampled
from lidarium.mapping.merging.pair import PairResult, described, explained, merge_pair
from lidarium.mapping.merging.settings import TOLERANCES, MergeSettings, merge_settings

HALMSTAD_M, REAL_M = 0.02, 0.05
"""Sides of the pixels of maps that do not say it [m]."""

RIGHT_M, RIGHT_ANGLE = 1.0, math.radians(8.0)
"""Errors of a right transform at the median correspondence [m, rad]: these maps are bent by up to 0.5 m."""

EXACT_M, EXACT_ANGLE = 0.5, math.radians(3.0)
"""The same where the truth is exact, at the middle of the overlap."""

TUNED_BUILDING = "E5"

ONE_BUILDING = {
    "intel_lab_bwi": "intel",
    "radish_intel": "intel",
    "mit_stata_basement": "stata",
    "mit_stata_hallways": "stata",
    "radish_csail": "stata",
}
"""Buildings of which there are several maps; the others are named as their map."""

PARTS = ("gdc_floor2_raw", "gdc_floor3_northeast")
"""Maps that are versions or parts of others."""

STRANGERS_OF_HALMSTAD = (
    "E5_01",
    "E5_08",
    "KPT4A_01",
    "KPT4A_03",
    "E5_03",
    "E5_05",
    "E5_12",
    "KPT4A_02",
    "KPT4A_04",
    "E5_10",
)


class Grid(NamedTuple):
    """A map: levels, row 0 at the lowest y, and side of a cell [m]."""

    levels: NDArray[np.uint8]
    resolution: float


@dataclass(frozen=True, slots=True)
class Row:
    """What the merger says of a pair.

    `pair`, `collection`: names of the maps, and where they come from: ``halmstad``, ``real``, ``log_split`` or
    ``strangers``; `is_tuned`: whether the model of strangers was fitted to the pair; `is_accepted`, `is_right`: whether
    it is joined, and whether the best transform is right; strangers have no right one; `distance_m`, `angle`: error of
    the best transform [m, rad]; `found_by`, `reason`: how it was found, and why it is refused; `confidence`, `bend_m`,
    `time_ms`: of the best hypothesis, and processor time, description included [ms]; `deviations`: distance of a
    right join from the truth at the middle of what agrees, in standard deviations of its covariance in the plane;
    `is_calibrated`: whether the covariance was fitted to the pair.
    """

    pair: str
    collection: str
    is_tuned: bool
    is_accepted: bool
    is_right: bool
    distance_m: float | None
    angle: float | None
    found_by: str
    reason: str
    confidence: float
    bend_m: float
    time_ms: float
    deviations: float | None = None
    is_calibrated: bool = False


def merge_real_maps(data: Path, settings: MergeSettings | None = None) -> list[dict[str, Any]]:
    """Merge all pairs of real maps below a folder, those of one building first.

    Returns a `Row` of each; none if the folder has none.
    """
    settings = settings or merge_settings()
    cv2.setNumThreads(1)
    folder = Path(data) / "map_pairs"
    if not folder.is_dir():
        return []
    rows = itertools.chain(
        _halmstad(folder / "halmstad", settings), _exact(folder, settings), _strangers(Path(data), settings)
    )
    return [asdict(row) for row in rows]


def transform_of_pixels(pixel: dict[str, float], resolution: float, rows_a: int, rows_b: int) -> Transform:
    """Return the transform from map b into a of a pair given in pixels.

    Its truth is q_a = R q_b + t in pixels whose y runs down.
    """
    theta = math.radians(pixel["theta_deg"])
    corner = Transform(pixel["tx"], pixel["ty"], theta).apply((0.0, rows_b))
    return Transform(float(corner[0]) * resolution, (rows_a - float(corner[1])) * resolution, -theta)


def correspondence_error(
    truth: dict[str, Any], resolution: float, rows: tuple[int, int], a_from_b: Transform
) -> tuple[float, float]:
    """Return the median distance of correspondences under a transform, and its error of rotation [m, rad].

    Correspondences are pixels whose y runs down, of maps a (``dst_pts``) and b (``src_pts``).
    """
    in_a, in_b = (
        np.column_stack([points[:, 0], count - points[:, 1]]) * resolution
        for points, count in zip((np.array(truth["dst_pts"]), np.array(truth["src_pts"])), rows, strict=True)
    )
    distance = float(np.median(np.linalg.norm(a_from_b.apply(in_b) - in_a, axis=1)))
    return distance, abs(math.remainder(a_from_b.theta + math.radians(truth["theta_deg"]), 2.0 * math.pi))


def _halmstad(folder: Path, settings: MergeSettings) -> Iterator[Row]:
    """Yield the usable pairs of sensor maps with correspondences."""
    if not (folder / "ground_truth.json.gz").is_file():
        return
    every = json.loads(gzip.decompress((folder / "ground_truth.json.gz").read_bytes())).items()
    usable = [(name, truth) for name, truth in every if truth.get("usable") and "layout" not in name]
    for number, (name, truth) in enumerate(usable):
        source, target = name.split("__")
        a, b = (Grid(read_grey_map(folder / f"{one}.png", HALMSTAD_M).levels, HALMSTAD_M) for one in (target, source))
        result, time_ms = _merged(a, b, settings)
        best, error = _best(result), None
        if best is not None:
            error = correspondence_error(truth, HALMSTAD_M, (len(a.levels), len(b.levels)), best)
        is_right = error is not None and error[0] < RIGHT_M and error[1] < RIGHT_ANGLE
        is_tuned = source.startswith(TUNED_BUILDING)
        row = _row((name, "halmstad"), is_tuned, (result, time_ms), error, is_right)
        wanted = transform_of_pixels(truth, HALMSTAD_M, len(a.levels), len(b.levels))
        yield replace(row, deviations=_deviations(row, result, wanted), is_calibrated=is_tuned and number % 2 == 0)


def _exact(folder: Path, settings: MergeSettings) -> Iterator[Row]:
    """Yield the pairs with an exact truth in pixels."""
    for collection in ("real", "log_split"):
        path = folder / collection / "ground_truth.json"
        if not path.is_file():
            continue
        for name, truth in json.loads(path.read_text(encoding="utf-8")).items():
            resolution = float(truth["resolution"]) if collection == "log_split" else REAL_M
            a, b = (Grid(read_grey_map(path.parent / truth[key], resolution).levels, resolution) for key in "AB")
            result, time_ms = _merged(a, b, settings)
            wanted = transform_of_pixels(truth.get("pixel", truth), resolution, len(a.levels), len(b.levels))
            best, error = _best(result), None
            if best is not None:
                error = best.difference(wanted, result.agreement.centre)
            is_right = error is not None and error[0] < EXACT_M and error[1] < EXACT_ANGLE
            is_tuned = collection == "log_split" and name.endswith("easy")
            row = _row((name, collection), is_tuned, (result, time_ms), error, is_right)
            yield replace(row, deviations=_deviations(row, result, wanted), is_calibrated=is_tuned)


def _strangers(data: Path, settings: MergeSettings) -> Iterator[Row]:
    """Yield all pairs of maps of different buildings; every other one was for tuning."""
    every = list(single_maps(data))
    pairs = [(first, second) for first, second in itertools.combinations(every, 2) if first[1] != second[1]]
    for number, ((a, _, grid), (b, _, other)) in enumerate(pairs, 1):
        yield _row((f"{a}, {b}", "strangers"), number % 2 == 0, _merged(grid, other, settings), None, is_right=False)


def single_maps(data: Path) -> Iterator[tuple[str, str, Grid]]:
    """Yield a name, a building and a map of each building, or two."""
    for path in sorted((data / "slam_maps").glob("*.yaml")):
        if path.stem not in PARTS:
            image = read_ros_map(path)
            yield path.stem, ONE_BUILDING.get(path.stem, path.stem), Grid(image.levels, image.resolution)
    folder = data / "map_pairs"
    for name in STRANGERS_OF_HALMSTAD:
        path = folder / "halmstad" / f"{name}.png"
        if path.is_file():
            grid = Grid(read_grey_map(path, HALMSTAD_M).levels, HALMSTAD_M)
            yield name, name.split("_")[0], grid
    path = folder / "real" / "soorajsunil_A.png"
    if path.is_file():
        yield path.stem, path.stem, Grid(read_grey_map(path, REAL_M).levels, REAL_M)


def _merged(a: Grid, b: Grid, settings: MergeSettings) -> tuple[PairResult, float]:
    """Return what comes of two maps, in cells of the coarser one, and how long it took [ms].

    What is explained of a pair that is joined at once is not in the time.
    """
    side = max(a.resolution, b.resolution)
    levels = [resampled(grid.levels, grid.resolution, side) for grid in (a, b)]
    began = time.process_time()
    first, second = (described(each, side, settings) for each in levels)
    result = merge_pair(first, second, settings)
    spent = 1e3 * (time.process_time() - began)
    return explained(first, second, result, settings), spent


def _best(result: PairResult) -> Transform | None:
    """Return the transform by which two maps are joined, or that for which most speaks."""
    if not result.is_accepted and result.ranked:
        return result.ranked[0].bend.a_from_b
    return result.a_from_b


def _deviations(row: Row, result: PairResult, wanted: Transform) -> float | None:
    """Return how far a right join is from the truth, in standard deviations; None of all others."""
    if not (row.is_accepted and row.is_right and result.a_from_b is not None and result.ranked):
        return None
    centre = np.asarray(result.agreement.centre)
    error = result.a_from_b.apply(centre) - wanted.apply(centre)
    return float(np.sqrt(error @ np.linalg.solve(result.ranked[0].bend.covariance[:2, :2], error)))


def _row(
    names: tuple[str, str],
    is_tuned: bool,
    found: tuple[PairResult, float],
    error: tuple[float, float] | None,
    is_right: bool,
) -> Row:
    result, time_ms = found
    distance_m, angle = (None, None) if error is None else error
    return Row(
        names[0],
        names[1],
        is_tuned,
        result.is_accepted,
        is_right,
        distance_m,
        angle,
        result.found_by,
        result.reason,
        round(result.confidence, 4),
        round(result.ranked[0].bend.bend_m, 4) if result.ranked else 0.0,
        round(time_ms, 3),
    )


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
        "Maps that others made of real buildings. A pair of Halmstad is right within 1 m and 8 degrees at the median "
        "correspondence, as these maps are bent by up to 0.5 m; others are within 0.5 m and 3 degrees. Strangers are "
        "all pairs of different buildings. The model was fitted to E5, the easy halves of logs, every other pair of "
        "strangers, and the bank's half for tuning.\n\n"
        + in_file("\n".join(lines))
        + "\n\nThe same by the confidence that is required of maps that agree only once they are bent "
        f"(`normal` is {TOLERANCES['normal']}, `drift` {TOLERANCES['drift']}):\n\n"
        + in_file(_curve(rows))
        + "\n\nEach pair of one building that is not joined, or wrong:\n\n"
        + _missed(rows)
        + "\n\n"
        + _held(rows)
    )


def _held(rows: Rows) -> str:
    """Return how often the truth is within two standard deviations of a right join."""
    lines = []
    for is_calibrated, pairs in ((True, "every other pair of E5 and the easy halves of logs"), (False, "the others")):
        found = [
            row["deviations"]
            for row in rows
            if row.get("deviations") is not None and row["is_calibrated"] == is_calibrated
        ]
        if found:
            share, half = Share(sum(each <= 2.0 for each in found), len(found)), np.median(found)
            lines.append(f"| {pairs} | {'yes' if is_calibrated else 'no'} | {share} | {half:.2f} |")
    return (
        "Covariances of right joins: distance from the truth in the plane, at the middle of the agreement, in standard "
        "deviations. A normal distribution has 86 % within two, and a median of 1.18.\n\n"
        "| pairs | fitted to | within two standard deviations | median |\n|---|---|---|---:|\n" + "\n".join(lines)
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
    lines = ["| confidence | right of one building | wrong of one building | strangers |", "|---|---|---|---|"]
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
            f"| {row['pair']} | {row['collection']} | {result} | {row['confidence']:.2f} | {error[0]} | {error[1]} |"
        )
    return "\n".join(lines)
