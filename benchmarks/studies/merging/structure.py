"""Merging by structure, on drawn floors: trials and tables."""

import itertools
import math
import time
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from lidarium.benchmarks.studies.merging.figures import Share, Tried
from lidarium.benchmarks.studies.merging.real_maps import merge_real_maps
from lidarium.evaluation.drawing.region_picture import RegionMap, save_region_picture
from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.grids.occupancy import FREE, OCCUPIED, UNKNOWN
from lidarium.mapping.merging.pair import described, merge_pair
from lidarium.mapping.merging.regions.graph import find_regions
from lidarium.mapping.merging.regions.segmentation import RegionSettings
from lidarium.mapping.merging.settings import STRUCTURES, merge_settings

SIDE_M = 0.05
"""Side of a cell [m]."""

KINDS = ("hall", "corridor")

_WALL = 3
_BEAMS, _REACH_M, _NOISE_M = 720, 8.0, 0.03
_STAND_M = 0.4


class View(NamedTuple):
    """What a robot has seen.

    `levels` (rows, columns) uint8: its map, in a frame of its own; `map_from_floor`: how the floor lies in it; `known`
    (rows, columns) bool: cells of the floor that it has seen.
    """

    levels: NDArray[np.uint8]
    map_from_floor: Transform
    known: NDArray[np.bool_]


def drawn_floor(kind: str, seed: int) -> NDArray[np.uint8]:
    """Return a floor in three levels, unknown outside."""
    generator = np.random.default_rng((KINDS.index(kind), seed))
    free = np.zeros((440, 640), np.uint8)
    (_draw_hall if kind == "hall" else _draw_corridor)(free, generator)
    walls = cv2.dilate(free, np.ones((2 * _WALL + 1, 2 * _WALL + 1), np.uint8))
    return np.where(free > 0, FREE, np.where(walls > 0, OCCUPIED, UNKNOWN)).astype(np.uint8)


def _draw_hall(free: NDArray[np.uint8], generator: np.random.Generator) -> None:
    """Draw a hall of five to seven slanted sides, with pillars and a closet or two."""
    count = int(generator.integers(5, 8))
    angles = (np.arange(count) + generator.uniform(-0.3, 0.3, count)) * (2.0 * math.pi / count)
    radii = generator.uniform(95, 150, count)
    corners = np.column_stack([320 + 1.4 * radii * np.cos(angles), 220 + radii * np.sin(angles)])
    cv2.fillPoly(free, [np.rint(corners).astype(np.int32)], (1,))
    for index in generator.choice(count, 2, replace=False).tolist():
        middle = 0.5 * (corners[index] + corners[(index + 1) % count])
        outwards = (middle - (320, 220)) / np.linalg.norm(middle - (320, 220))
        ends = np.array([middle - 6 * outwards, middle + (_WALL + 12) * outwards])
        cv2.polylines(free, [np.rint(ends).astype(np.int32)], False, (1,), 18)
        room = cv2.boxPoints(
            (tuple((middle + 40 * outwards).tolist()), (52.0, 52.0), math.degrees(math.atan2(outwards[1], outwards[0])))
        )
        cv2.fillPoly(free, [np.rint(room).astype(np.int32)], (1,))
    for x, y in generator.uniform((250, 170), (390, 270), (3, 2)).astype(int).tolist():
        cv2.circle(free, (x, y), 5, (0,), -1)


def _draw_corridor(free: NDArray[np.uint8], generator: np.random.Generator) -> None:
    """Draw a corridor with rooms on both sides, each behind a door."""
    half = int(generator.integers(16, 24))
    length = int(generator.integers(380, 520))
    free[220 - half : 220 + half, 60 : 60 + length] = 1
    for side in (-1, 1):
        left = 60
        while left < 60 + length - 50:
            width = min(int(generator.integers(50, 110)), 60 + length - left)
            depth = int(generator.integers(50, 110))
            near, far = 220 + side * (half + _WALL), 220 + side * (half + _WALL + depth)
            free[min(near, far) : max(near, far), left : left + width] = 1
            door = left + int(generator.integers(6, width - 24))
            gap = 220 + side * half, near
            free[min(gap) : max(gap), door : door + int(generator.integers(16, 21))] = 1
            left += width + _WALL


def seen_by(
    floor: NDArray[np.uint8], share: tuple[float, float], map_from_floor: Transform, seed: tuple[int, ...]
) -> View:
    """Return what a robot sees from places within a part of a floor.

    `floor` (rows, columns) uint8: the floor; `share` (from, to): the part, along its columns.
    """
    generator = np.random.default_rng(seed)
    clear = cv2.distanceTransform((floor == FREE).astype(np.uint8), cv2.DIST_L2, 5) * SIDE_M
    rows, columns = np.nonzero(clear > _STAND_M)
    low, high = np.quantile(columns, share)
    places = np.flatnonzero((columns >= low) & (columns <= high))
    shape = (820, 820)
    known, levels = np.zeros(floor.shape, np.bool_), np.full(shape, UNKNOWN, np.uint8)
    for place in generator.choice(places, 9, replace=False).tolist():
        middle = (np.array((columns[place], rows[place])) + 0.5) * SIDE_M
        free, hits = _scan(floor, middle, generator)
        for points, level in ((free, FREE), (hits, OCCUPIED)):
            x, y = np.floor(points / SIDE_M).astype(np.int64).T
            known[np.clip(y, 0, floor.shape[0] - 1), np.clip(x, 0, floor.shape[1] - 1)] = True
            x, y = np.floor(map_from_floor.apply(points) / SIDE_M).astype(np.int64).T
            is_on = (x >= 0) & (y >= 0) & (x < shape[1]) & (y < shape[0])
            levels[y[is_on], x[is_on]] = np.where(levels[y[is_on], x[is_on]] == OCCUPIED, OCCUPIED, level)
    return View(levels, map_from_floor, known)


def _scan(
    floor: NDArray[np.uint8], middle: NDArray[np.float64], generator: np.random.Generator
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return points of free space along the beams, and where they end on walls, both (n, 2) [m]."""
    angles = np.arange(_BEAMS) * (2.0 * math.pi / _BEAMS)
    ahead = np.column_stack([np.cos(angles), np.sin(angles)])
    ranges = np.arange(0.0, _REACH_M, 0.5 * SIDE_M)
    points = middle + ranges[None, :, None] * ahead[:, None]
    cells = np.floor(points / SIDE_M).astype(np.int64)
    x = np.clip(cells[..., 0], 0, floor.shape[1] - 1)
    y = np.clip(cells[..., 1], 0, floor.shape[0] - 1)
    is_wall = floor[y, x] != FREE
    ends = np.where(is_wall.any(axis=1), is_wall.argmax(axis=1), len(ranges))
    measured = ranges[np.minimum(ends, len(ranges) - 1)] + generator.normal(0.0, _NOISE_M, _BEAMS)
    is_hit = ends < len(ranges)
    is_free = ranges[None] < measured[:, None] - SIDE_M
    return points[is_free], (middle + measured[:, None] * ahead)[is_hit]


FLOORS = 30
"""Floors of each kind: a pair of one floor each, and each with the next as strangers."""

LEAST_OVERLAP = 0.3
"""Of what the robot that has seen less has seen, the other has seen this share at least."""

RIGHT_M, RIGHT_ANGLE = 0.1, math.radians(1.0)
"""Errors of a right transform at the middle of the overlap [m, rad], as in the bank."""

_PARTS = (0.0, 0.65), (0.35, 1.0)


@dataclass(frozen=True, slots=True)
class StructureRow:
    """What comes of the pairs of one collection with one structure.

    `collection`, `structure`: which pairs, and what proposes their transforms; `pairs`, `right`, `wrong`: number of
    pairs, of those joined right, and of those joined wrong; `median_ms`, `most_ms`: processor time of a pair, maps
    described, as median and 95 % [ms].
    """

    collection: str
    structure: str
    pairs: int
    right: int
    wrong: int
    median_ms: float
    most_ms: float


class _Tried(NamedTuple):
    is_accepted: bool
    is_right: bool
    time_ms: float


class FloorPair(NamedTuple):
    """Two maps, and where they lie if they are of one floor: transform and middle of the overlap."""

    a: NDArray[np.uint8]
    b: NDArray[np.uint8]
    a_from_b: Transform | None
    middle: tuple[float, float]


def compare_structures(data: Path | None, floors: int = FLOORS) -> list[dict[str, Any]]:
    """Join pairs of drawn floors, and of real maps if there are some, by each structure.

    Returns a `StructureRow` of each collection and structure.
    """
    cv2.setNumThreads(1)
    rows = []
    for kind in KINDS:
        pairs = list(floor_pairs(kind, floors))
        for structure in STRUCTURES:
            tried = list(_tried(pairs, structure))
            for name, is_stranger in ((f"{kind}s", False), (f"{kind}s, strangers", True)):
                chosen = [one for one, pair in zip(tried, pairs, strict=True) if (pair.a_from_b is None) == is_stranger]
                rows.append(_row(name, structure, chosen))
    if data is not None:
        rows += [row for structure in STRUCTURES for row in _real_rows(data, structure)]
    return [asdict(row) for row in rows]


def floor_pairs(kind: str, floors: int) -> Iterator[FloorPair]:
    """Yield pairs of maps of one floor that overlap enough, and of each floor with the next."""
    views = []
    for seed in range(floors):
        generator = np.random.default_rng((7, seed))
        floor = drawn_floor(kind, seed)
        frames = [_frame(generator.uniform(-math.pi, math.pi)) for _ in _PARTS]
        views.append(
            [seen_by(floor, part, frame, (seed, k)) for k, (part, frame) in enumerate(zip(_PARTS, frames, strict=True))]
        )
    for (first, second), (other, _) in itertools.pairwise([*views, views[0]]):
        both = first.known & second.known
        if both.sum() >= LEAST_OVERLAP * min(first.known.sum(), second.known.sum()):
            rows, columns = np.nonzero(both)
            place = np.array((columns.mean(), rows.mean())) * SIDE_M
            x, y = second.map_from_floor.apply(place).tolist()
            a_from_b = first.map_from_floor @ second.map_from_floor.inverse()
            yield FloorPair(first.levels, second.levels, a_from_b, (x, y))
        yield FloorPair(second.levels, other.levels, None, (0.0, 0.0))


def _frame(theta: float) -> Transform:
    """Return how a floor lies in a robot's map: turned about its middle."""
    middle = np.array((16.0, 11.0))
    x, y = (np.array((20.5, 20.5)) - Transform(0.0, 0.0, theta).apply(middle)).tolist()
    return Transform(x, y, theta)


def _tried(pairs: Iterable[FloorPair], structure: str) -> Iterator[_Tried]:
    """Yield what comes of each pair."""
    settings = replace(merge_settings("default", SIDE_M), structure=structure)
    for pair in pairs:
        a, b = (described(levels, SIDE_M, settings) for levels in (pair.a, pair.b))
        began = time.process_time()
        result = merge_pair(a, b, settings)
        spent = 1e3 * (time.process_time() - began)
        is_right = False
        if pair.a_from_b is not None and result.a_from_b is not None:
            distance, angle = result.a_from_b.difference(pair.a_from_b, pair.middle)
            is_right = distance <= RIGHT_M and angle <= RIGHT_ANGLE
        yield _Tried(result.is_accepted, is_right, spent)


def _real_rows(data: Path, structure: str) -> Iterator[StructureRow]:
    """Yield what comes of the real maps below a folder."""
    rows = merge_real_maps(data, replace(merge_settings(), structure=structure))
    for collection in dict.fromkeys(row["collection"] for row in rows):
        chosen = [
            _Tried(row["is_accepted"], row["is_right"], row["time_ms"])
            for row in rows
            if row["collection"] == collection
        ]
        yield _row(collection, structure, chosen)


def _row(collection: str, structure: str, tried: list[_Tried]) -> StructureRow:
    times = [one.time_ms for one in tried] or [0.0]
    return StructureRow(
        collection,
        structure,
        len(tried),
        sum(one.is_accepted and one.is_right for one in tried),
        sum(one.is_accepted and not one.is_right for one in tried),
        round(float(np.median(times)), 1),
        round(float(np.quantile(times, 0.95)), 1),
    )


Rows = list[dict[str, Any]]


def structure_text(rows: Rows, bank: dict[str, Tried]) -> str:
    """Return how many pairs each structure joins."""
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
        "Transforms are proposed by corners (the default from Python and in teams), by regions of free space and the "
        "doors between them, or by both (`all`, the default of `lidarium merge`); then all rotations and translations "
        "are tried. Halls have slanted walls and pillars, corridors rooms on both sides; both are drawn from seeds, "
        "and two robots see about two thirds of each from nine places. Strangers are each floor and the next. Times of "
        "the bank and of real maps include the description of both maps.\n\n"
        + "\n".join(lines)
        + "\n\nDrawn corridors are much alike: a door every few metres, nothing else. Bent by up to 0.6 m, some "
        "strangers among them fit; `--tolerance strict` joins no maps that have to be bent. Refused proposals of "
        "regions are therefore not bent."
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
