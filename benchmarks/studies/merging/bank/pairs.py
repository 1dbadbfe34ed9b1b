"""Which pairs of the bank's maps are asked for, and what is true of each.

What looks alike is looked for in the truth: the floor's own cells, as far as each map knows them, without
noise or error. Both floors have their walls along the axes, so that four rotations are enough.
"""

import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from functools import cached_property, lru_cache
from itertools import combinations

import cv2
import numpy as np
from numpy.typing import NDArray

from lidarium.benchmarks.studies.merging.bank.bank import BankMap, Pair
from lidarium.benchmarks.studies.merging.bank.drives import RESOLUTION
from lidarium.benchmarks.studies.merging.bank.floors import HALVES, LASER_HEIGHT, BankFloor
from lidarium.envs.floors.floor import Raster
from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.grids.occupancy import FREE, OCCUPIED, UNKNOWN
from lidarium.mapping.merging.agreement import Agreement, ValidationSettings, compare
from lidarium.mapping.merging.alignment import distinct
from lidarium.mapping.merging.corners import CornerSettings
from lidarium.mapping.merging.correlation import CorrelationSettings, best_translations
from lidarium.mapping.merging.described_map import DescribedMap, describe_map
from lidarium.mapping.merging.wall_alignment import refine_on_walls

OVERLAPPING, PLENTY, APART = 0.15, 0.30, 0.02
"""Overlaps of positive pairs, of plentiful overlap, and of different places.

From the first on maps are positives, from the second they overlap plenty; below the third they are apart.
"""

DIFFERENT_M = 1.0
"""Length of walls by which look-alikes differ at least [m]."""

ALIKE_M, ALIKE_SHARE = 5.0, 0.7
"""Length of agreeing wall [m] and its share from which places look alike.

The wall agrees in truth; the share is of the walls in the overlap.
"""

AS_WELL = 0.9
"""Share of walls from which another transform makes a positive symmetric.

This share of its walls agrees under the transform, and less than `DIFFERENT_M` differs.
"""

_SLIDES = [Transform(0.3 * x, 0.3 * y, 0.0) for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1))]
"""Shifts tested along a corridor of which both maps know no end. Every such shift explains them as well."""

_QUARTERS = np.arange(4) * (math.pi / 2.0)
_TRUTH = ValidationSettings(hit_distance_m=0.05, miss_distance_m=0.1)
_SEARCH = CorrelationSettings(cell_m=0.1, peaks=12)


@dataclass(frozen=True, slots=True, kw_only=True)
class Wanted:
    """How many pairs are wanted in each half, of each kind."""

    plenty: int = 220
    little: int = 120
    negative: int = 420
    like_places: int = 60
    copies: int = 120
    indistinct: int = 30

    def part(self, every: int) -> "Wanted":
        """Return an N-th of what is wanted, three of each kind at least."""
        return Wanted(**{kind: max(round(count / every), min(count, 3)) for kind, count in asdict(self).items()})


@dataclass(frozen=True, eq=False)
class _Known:
    """A map with the truth of what it knows. The truth is in the floor's frame less the raster's origin."""

    map: BankMap

    @cached_property
    def truth(self) -> DescribedMap:
        """The floor's cells that the map knows."""
        return describe_map(true_levels(self.map), RESOLUTION, CornerSettings(limit=1))

    def truth_from_map(self) -> Transform:
        """Return the transform from the map into the frame of the truth."""
        origin = _raster(self.map.floor).origin
        return Transform(-origin[0], -origin[1], 0.0) @ self.map.floor_from_map


def true_levels(one: BankMap) -> NDArray[np.uint8]:
    """Return the floor's own cells that a map knows, on the floor's grid: no noise, no error of poses."""
    raster = _raster(one.floor)
    pose = Transform(-raster.origin[0], -raster.origin[1], 0.0) @ one.floor_from_map
    cosine, sine = math.cos(pose.theta), math.sin(pose.theta)
    # The centre of pixel (0, 0) is half a cell from the corner.
    x, y = (pose.x / RESOLUTION + 0.5 * (cosine - sine) - 0.5, pose.y / RESOLUTION + 0.5 * (sine + cosine) - 0.5)
    mask = cv2.warpAffine(
        (one.levels != UNKNOWN).astype(np.uint8),
        np.array([[cosine, -sine, x], [sine, cosine, y]]),
        raster.solid.shape[::-1],
        flags=cv2.INTER_NEAREST,
    )
    beside = cv2.dilate(mask, np.ones((7, 7), np.uint8))
    levels = np.full(raster.solid.shape, UNKNOWN, np.uint8)
    levels[(mask > 0) & (raster.solid == 0)] = FREE
    levels[(beside > 0) & (raster.solid != 0)] = OCCUPIED
    return levels


def choose_pairs(maps: dict[str, BankMap], seed: int = 0, wanted: Wanted | None = None) -> Iterator[Pair]:
    """Yield the pairs of a bank, those of the tuning half first."""
    wanted = wanted or Wanted()
    for half in HALVES:
        generator = np.random.default_rng([seed, HALVES.index(half)])
        known = [_Known(one) for one in maps.values() if one.floor.half == half]
        originals = [one for one in known if not one.map.floor.is_copy]
        yield from _within_floors(originals, half, wanted, generator)
        yield from _copies(known, half, wanted, generator)
        yield from _across_floors(originals, half, wanted, generator)


def overlap_of(a: BankMap, b: BankMap, a_from_b: Transform, stride: int = 3) -> tuple[float, tuple[float, float]]:
    """Return the overlap of two maps, and its centroid in map b [m].

    The overlap is what both maps know, as a share of the smaller known area.
    """
    rows, columns = np.nonzero(b.levels[::stride, ::stride] != UNKNOWN)
    places = (np.stack([columns, rows], axis=1) * stride + 0.5) * RESOLUTION
    cells = np.floor(a_from_b.apply(places) / RESOLUTION).astype(np.int64)
    inside = (cells >= 0).all(axis=1) & (cells[:, 0] < a.levels.shape[1]) & (cells[:, 1] < a.levels.shape[0])
    both = inside.copy()
    both[inside] = a.levels[cells[inside, 1], cells[inside, 0]] != UNKNOWN
    if not both.any():
        return 0.0, (0.0, 0.0)
    smaller = min(int(np.count_nonzero(one.levels[::stride, ::stride] != UNKNOWN)) for one in (a, b))
    x, y = places[both].mean(axis=0).tolist()
    return float(np.count_nonzero(both)) / smaller, (x, y)


def _within_floors(known: list[_Known], half: str, wanted: Wanted, generator: np.random.Generator) -> Iterator[Pair]:
    """Yield pairs of maps of one floor, made from different starts."""
    room = {
        "plenty": wanted.plenty,
        "little": wanted.little,
        "apart": wanted.like_places,
        "indistinct": wanted.indistinct,
    }
    candidates = [
        (a, b) for a, b in combinations(known, 2) if a.map.floor == b.map.floor and a.map.start != b.map.start
    ]
    for index in generator.permutation(len(candidates)).tolist():
        a, b = candidates[index]
        true = a.map.floor_from_map.inverse() @ b.map.floor_from_map
        overlap, at = overlap_of(a.map, b.map, true)
        kind = (
            "plenty"
            if overlap >= PLENTY
            else "little"
            if overlap >= OVERLAPPING
            else "apart"
            if overlap < APART
            else None
        )
        if kind is None or room[kind] == 0:
            continue
        pair = Pair(a.map.key, b.map.key, half, "positive", round(overlap, 4), (true.x, true.y, true.theta), at)
        if kind == "apart":
            pair = replace(_judged_negative(pair, a, b), pose=None)
            kind = "indistinct" if pair.category == "indistinct" else kind
            if pair.category == "negative" or room[kind] == 0:
                continue
        elif _is_symmetric(a, b):
            pair = replace(pair, category="symmetric")
        room[kind] -= 1
        yield pair


def _copies(known: list[_Known], half: str, wanted: Wanted, generator: np.random.Generator) -> Iterator[Pair]:
    """Yield pairs of a floor's and its copy's maps: the same place, whose furniture was taken away.

    Most of them have both seen what was taken away.
    """
    room = {True: wanted.copies, False: wanted.indistinct}
    originals = [one for one in known if not one.map.floor.is_copy]
    copies = [one for one in known if one.map.floor.is_copy]
    candidates = [(a, b) for a in originals for b in copies if b.map.floor.original == a.map.floor.name]
    for index in generator.permutation(len(candidates)).tolist():
        a, b = candidates[index]
        true = a.map.floor_from_map.inverse() @ b.map.floor_from_map
        overlap, at = overlap_of(a.map, b.map, true)
        if overlap < OVERLAPPING:
            continue
        differing = compare(a.truth, b.truth, Transform(), _TRUTH).contradicting_m
        has_seen = differing >= DIFFERENT_M
        if room[has_seen] > 0:
            room[has_seen] -= 1
            pose = (true.x, true.y, true.theta)
            yield Pair(a.map.key, b.map.key, half, "refurnished", round(overlap, 4), pose, at, round(differing, 3))


def _across_floors(known: list[_Known], half: str, wanted: Wanted, generator: np.random.Generator) -> Iterator[Pair]:
    """Yield pairs of maps of different floors, if there are any."""
    if len({one.map.floor for one in known}) < 2:
        return
    for _ in range(wanted.negative):
        while True:
            a, b = (known[int(index)] for index in generator.integers(0, len(known), 2))
            if a.map.floor != b.map.floor:
                break
        yield Pair(a.map.key, b.map.key, half, "negative")


def _judged_negative(pair: Pair, a: _Known, b: _Known) -> Pair:
    """Return a pair of two places in the category of what it looks like.

    It can be decided where every overlay that looks alike differs somewhere.
    """
    looks = [one for _, one in _alignments(a, b) if one.agreeing_m >= ALIKE_M and one.hit_rate >= ALIKE_SHARE]
    if not looks:
        return replace(pair, category="negative")
    least = min(one.contradicting_m for one in looks)
    return replace(pair, category="look_alike" if least >= DIFFERENT_M else "indistinct", differing_m=round(least, 3))


def _is_symmetric(a: _Known, b: _Known) -> bool:
    """Return whether another transform explains two maps as well as the true one.

    The maps are of one floor; what is true of them is compared.
    """
    truth = compare(a.truth, b.truth, Transform(), _TRUTH)
    slides = [(slide, compare(a.truth, b.truth, slide, _TRUTH)) for slide in _SLIDES]
    for transform, agreement in [*slides, *_alignments(a, b)]:
        distance, angle = transform.difference(Transform(), truth.centre)
        is_other = distance > 0.25 or angle > math.radians(5.0)
        if is_other and agreement.contradicting_m < DIFFERENT_M and agreement.agreeing_m >= AS_WELL * truth.agreeing_m:
            return True
    return False


def _alignments(a: _Known, b: _Known) -> list[tuple[Transform, Agreement]]:
    """Return the transforms under which the truth of two maps looks most alike. How alike it looks is returned, too."""
    transforms, values = best_translations(a.truth, b.truth, _QUARTERS, _SEARCH)
    order = np.argsort(-values, kind="stable")
    middle: NDArray[np.float64] = b.truth.walls.mean(axis=0) if len(b.truth.walls) else np.zeros(2)
    chosen = distinct(transforms, order, middle, 24, (0.5, math.radians(5.0)))
    refined = [refine_on_walls(a.truth, b.truth, Transform(*transforms[k].tolist()), 0.2, 400) for k in chosen]
    return [(transform, compare(a.truth, b.truth, transform, _TRUTH)) for transform in refined]


@lru_cache(maxsize=64)
def _raster(floor: BankFloor) -> Raster:
    return floor.load().raster(RESOLUTION, LASER_HEIGHT, LASER_HEIGHT)
