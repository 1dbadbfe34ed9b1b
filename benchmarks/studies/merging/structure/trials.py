"""Pairs of maps joined by corners, by regions, and by both: how many are right, and how long it takes."""

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

from lidarium.benchmarks.studies.merging.real_maps import merge_real_maps
from lidarium.benchmarks.studies.merging.structure.drawn_floors import KINDS, SIDE_M, drawn_floor, seen_by
from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.merging.pair import described, merge_pair
from lidarium.mapping.merging.settings import STRUCTURES, merge_settings

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

    Attributes
    ----------
    collection, structure : str
        Which pairs, and what proposes their transforms.
    pairs, right, wrong : int
        Number of pairs, of those joined right, and of those joined wrong.
    median_ms, most_ms : float
        Processor time of a pair, maps described, as median and 95 % [ms].
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
    """Join pairs of drawn floors, and of real maps where there are some, by each structure.

    Returns a `StructureRow` of each collection and structure.
    """
    cv2.setNumThreads(1)
    rows = []
    for kind in KINDS:
        pairs = list(floor_pairs(kind, floors))
        for structure in STRUCTURES:
            tried = list(_tried(pairs, structure))
            for name, is_stranger in ((f"{kind}s", False), (f"{kind}s, strangers", True)):
                chosen = [
                    one
                    for one, pair in zip(tried, pairs, strict=True)
                    if (pair.a_from_b is None) == is_stranger
                ]
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
            [
                seen_by(floor, part, frame, (seed, k))
                for k, (part, frame) in enumerate(zip(_PARTS, frames, strict=True))
            ]
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
