"""Whether two overlaid maps show one place.

The default test counts cells known to both maps: walls that lie on walls, and walls of one at cells where the
other has observed and found nothing. A transform is refused if too little agrees, if enough
contradicts, or if another transform explains the maps nearly as well. The disc test of the thesis compares
cells around the inliers only, unknown ones included.

Distinct walls are counted, too: two corners of one corridor agree over tens of metres of wall, and yet in
four walls alone. Two maps of one room agree in as many walls as it has.
"""

import math
from dataclasses import dataclass, replace
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.bounds import Distance, FromZero, Turn, check_settings, share, within
from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.geometry.small_matrices import eigenvalues
from lidarium.mapping.grids.occupancy import FREE, UNKNOWN
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.merging.described_map import FACING_DISTANCE_M, DescribedMap, faces_away

STRIDE = 3
"""Areas are counted on every so many-th cell."""


def disc_agreement(
    a: DescribedMap, b: DescribedMap, a_from_b: Transform, points: NDArray[np.float64], radius_cells: int
) -> float:
    """Return the share of map b's cells within discs whose state in map a agrees.

    The discs are around points [m of map b].

    Unknown is a state as others are; cells outside of map a are unknown. A cell in several discs counts
    once.
    """
    if len(points) == 0:
        return 0.0
    is_inside = np.zeros(b.levels.shape, np.bool_)
    counts = np.zeros(2, np.int64)
    _count_discs(a.levels, b.levels, a.resolution, _pose_numbers(a_from_b), points, radius_cells, is_inside, counts)
    return float(counts[0]) / float(counts[1]) if counts[1] else 0.0


def _pose_numbers(transform: Transform) -> tuple[float, float, float]:
    """Return a transform as the numbers that kernels take: x, y [m], theta [rad]."""
    return transform.x, transform.y, transform.theta


class WallField(NamedTuple):
    """Arrays that walls of another map are compared with; see ``DescribedMap``.

    Attributes
    ----------
    levels, distance, is_open : (rows, columns) uint8, float32, uint8
        Cells of the map, distances to its walls [m], and whether all around is free.
    scale : float
        Cells in a metre [1/m].
    hit, miss : float
        Distances up to which walls agree, and from which they contradict [m].
    """

    levels: Array
    distance: Array
    is_open: Array
    scale: float
    hit: float
    miss: float


@kernel
def count_walls(
    field: WallField,
    walls: Array,
    normals: Array,
    pose: tuple[float, float, float],
    counts: Array,
    facing: Array,
) -> None:
    """Count the walls that agree, that miss by little, and that contradict.

    Sum the squares of the normals of those that agree.
    """
    levels, distance, scale = field.levels, field.distance, field.scale
    rows, columns = levels.shape
    cosine, sine = math.cos(pose[2]) * scale, math.sin(pose[2]) * scale
    x0, y0 = pose[0] * scale, pose[1] * scale
    for i in range(walls.shape[0]):
        column = cosine * walls[i, 0] - sine * walls[i, 1] + x0
        row = sine * walls[i, 0] + cosine * walls[i, 1] + y0
        x, y = int(math.floor(column)), int(math.floor(row))
        if 0 <= x < columns and 0 <= y < rows:
            if distance[y, x] <= field.hit:
                ahead_x = FACING_DISTANCE_M * (cosine * normals[i, 0] - sine * normals[i, 1])
                ahead_y = FACING_DISTANCE_M * (sine * normals[i, 0] + cosine * normals[i, 1])
                if faces_away(levels, column, row, ahead_x, ahead_y):
                    counts[1] += 1
                    continue
                counts[0] += 1
                facing[0] += normals[i, 0] * normals[i, 0]
                facing[1] += normals[i, 0] * normals[i, 1]
                facing[2] += normals[i, 1] * normals[i, 1]
            elif levels[y, x] == FREE:
                counts[2 if field.is_open[y, x] != 0 and distance[y, x] > field.miss else 1] += 1


@kernel
def _count_overlap(a: Array, b: Array, side: float, pose: tuple[float, float, float], found: Array) -> None:
    """Count the cells known in both maps, and find their centroid in b [m].

    Step between examined cells, along rows and columns.
    """
    rows, columns = a.shape
    cosine, sine = math.cos(pose[2]), math.sin(pose[2])
    count, column_sum, row_sum = 0, 0, 0
    for row in range(STRIDE // 2, b.shape[0], STRIDE):
        x = (cosine * 0.5 - sine * (row + 0.5)) + pose[0] / side
        y = (sine * 0.5 + cosine * (row + 0.5)) + pose[1] / side
        for column in range(STRIDE // 2, b.shape[1], STRIDE):
            if b[row, column] != UNKNOWN:
                c, r = int(math.floor(x + cosine * column)), int(math.floor(y + sine * column))
                if 0 <= c < columns and 0 <= r < rows and a[r, c] != UNKNOWN:
                    count += 1
                    column_sum += column
                    row_sum += row
    found[0] = 1.0 * count * STRIDE**2
    found[1] = (column_sum + 0.5 * count) * side * STRIDE**2
    found[2] = (row_sum + 0.5 * count) * side * STRIDE**2


@kernel
def _count_discs(
    a: Array,
    b: Array,
    side: float,
    pose: tuple[float, float, float],
    points: Array,
    radius: int,
    is_inside: Array,
    counts: Array,
) -> None:
    """Count the cells of b in the discs that are the same in a, and all of them."""
    cosine, sine = math.cos(pose[2]), math.sin(pose[2])
    for i in range(points.shape[0]):
        middle_column, middle_row = int(math.floor(points[i, 0] / side)), int(math.floor(points[i, 1] / side))
        for row in range(max(middle_row - radius, 0), min(middle_row + radius + 1, b.shape[0])):
            for column in range(max(middle_column - radius, 0), min(middle_column + radius + 1, b.shape[1])):
                if is_inside[row, column] or (row - middle_row) ** 2 + (column - middle_column) ** 2 > radius * radius:
                    continue
                is_inside[row, column] = True
                x = cosine * (column + 0.5) - sine * (row + 0.5) + pose[0] / side
                y = sine * (column + 0.5) + cosine * (row + 0.5) + pose[1] / side
                c, r = int(math.floor(x)), int(math.floor(y))
                state = a[r, c] if 0 <= c < a.shape[1] and 0 <= r < a.shape[0] else np.uint8(UNKNOWN)
                counts[0] += np.int64(state == b[row, column])
                counts[1] += 1


OCCUPIED_WEIGHT = 10.0
"""How much more an occupied cell counts than a free one in the score."""


TESTS = ("walls", "discs")
Share = Annotated[float, share()]


@dataclass(frozen=True, slots=True, kw_only=True)
class ValidationSettings:
    """When a transform is believed.

    Attributes
    ----------
    test : str
        ``walls``: over all that both maps know; ``discs``: cells around the inliers, of the thesis.
    hit_distance_m : float, default 0.075
        A wall agrees if the other map has one within this distance [m], or within a cell and a half.
    miss_distance_m : float, default 0.175
        A wall contradicts if it is in the open of the other map, farther than this from any wall [m].
    least_overlap_m2 : float, default 5.0
        Least area that both know [m2].
    least_wall_m : float, default 3.0
        Least length of walls that agree [m].
    least_evidence_m : float, default 3.5
        Least length of walls that agree, less that of walls that do not and three times that of walls that
        contradict [m].
    least_across_m : float, default 0.4
        Least length of walls that hold the maps in the direction in which they are held least [m]: two
        straight corridors agree wherever they are overlaid.
    least_across_share : float, default 0.0
        The same as a share of the walls that agree, which is at most a half: along a corridor hardly any
        walls hold.
    least_evidence_per_m2 : float, default 0.0
        Least evidence on each square metre that both know [m/m2]: open floor agrees with open floor anywhere.
    hit_rate : float, default 0.7
        Least share of the walls in the overlap that agree.
    score : float, default 0.9
        Least score.
    most_contradiction_m : float, default 0.15
        Length of contradicting walls that is excused [m].
    plenty_of_overlap_m2, plenty_of_wall_m, contradiction_share : float, default 250.0, 200.0, 0.1
        If both know this area [m2], this share of the walls beyond this length [m] may contradict too: maps
        of whole buildings drift.
    rival_distance_m, rival_angle : float
        A transform is another one if it differs by more than this [m, rad].
    rival_share : float, default 0.6
        A rival that nothing contradicts makes the best transform ambiguous if the walls that agree under
        it are longer than this share of those under the best.
    rival_lead : float, default 1.5
        A rival that is refused still speaks against the best transform if this multiple of wall speaks
        for it.
    disc_radius_cells : int, default 25
        Radius of the discs [cells].
    disc_agreement : float, default 0.9
        More than this share of the cells in the discs must be the same in both maps.
    """

    test: str = "walls"
    hit_distance_m: Distance = 0.075
    miss_distance_m: Distance = 0.175
    least_overlap_m2: FromZero = 5.0
    least_wall_m: FromZero = 3.0
    least_evidence_m: FromZero = 3.5
    least_across_m: FromZero = 0.4
    least_across_share: Share = 0.0
    least_evidence_per_m2: FromZero = 0.0
    hit_rate: Share = 0.7
    score: Share = 0.9
    most_contradiction_m: FromZero = 0.15
    plenty_of_overlap_m2: FromZero = 250.0
    plenty_of_wall_m: FromZero = 200.0
    contradiction_share: Share = 0.1
    rival_distance_m: Distance = 0.5
    rival_angle: Turn = math.radians(5.0)
    rival_share: Share = 0.6
    rival_lead: FromZero = 1.5
    disc_radius_cells: Annotated[int, within(1, 1000)] = 25
    disc_agreement: Share = 0.90

    def __post_init__(self) -> None:
        check_settings(self, "validation")
        if self.test not in TESTS:
            raise ValueError(f"test of validation is {self.test!r}; want one of {', '.join(TESTS)}")


@dataclass(frozen=True, slots=True)
class Agreement:
    """Evidence of two overlaid maps for and against the transform.

    Attributes
    ----------
    overlap_m2 : float
        Area known in both [m2].
    centre : (x, y)
        Its centroid in map b [m].
    agreeing_m : float
        Length of walls that lie on walls, mean of both maps [m].
    wall_m : float
        Length of walls in known cells of the other map, mean of both maps [m].
    across_m : float
        Length of walls that hold the maps in the direction in which they are held least: 0 for a straight
        wall, whatever its length [m].
    contradicting_m : float
        Length of walls in the free space of the other map, the sum of both maps [m].
    score : float
        1 less the share of cells that contradict, occupied ones weighted `OCCUPIED_WEIGHT`.
    """

    overlap_m2: float = 0.0
    centre: tuple[float, float] = (0.0, 0.0)
    agreeing_m: float = 0.0
    wall_m: float = 0.0
    across_m: float = 0.0
    contradicting_m: float = 0.0
    score: Share = 0.0

    @property
    def hit_rate(self) -> float:
        """Share of the walls in the overlap that agree."""
        return self.agreeing_m / self.wall_m if self.wall_m > 0.0 else 0.0

    @property
    def evidence_m(self) -> float:
        """Evidence: agreeing walls less those that do not and those that contradict [m].

        Contradicting walls weigh more.
        """
        return 2.0 * self.agreeing_m - self.wall_m - 3.0 * self.contradicting_m


def compare(a: DescribedMap, b: DescribedMap, a_from_b: Transform, settings: ValidationSettings) -> Agreement:
    """Compare map b with map a under a transform."""
    side = a.resolution
    hit, miss = max(settings.hit_distance_m, 1.5 * side), max(settings.miss_distance_m, 2.5 * side)
    b_from_a = a_from_b.inverse()
    walls, facing = np.zeros((2, 3), np.int64), np.zeros((2, 3))
    for k, (field_of, walls_of, transform) in enumerate(((a, b, a_from_b), (b, a, b_from_a))):
        field = WallField(field_of.levels, field_of.distance, field_of.is_open, 1.0 / side, hit, miss)
        count_walls(field, walls_of.walls, walls_of.normals, _pose_numbers(transform), walls[k], facing[k])
    return agreement_of(a, b, a_from_b, walls, facing)


def agreement_of(
    a: DescribedMap,
    b: DescribedMap,
    a_from_b: Transform,
    walls: NDArray[np.int64],
    facing: NDArray[np.float64],
) -> Agreement:
    """Return the agreement of two maps of which the walls have been counted.

    Parameters
    ----------
    a, b : DescribedMap
        Maps of one resolution.
    a_from_b : Transform
        Maps points of b into a.
    walls : (2, 3) int64
        Wall cells of each map that agree, miss by little, and contradict.
    facing : (2, 3) float64
        Sums of the squares of the normals of those that agree: xx, xy, yy.
    """
    side, area = a.resolution, np.zeros(3)
    _count_overlap(a.levels, b.levels, side, _pose_numbers(a_from_b), area)
    both = float(area[0])
    hits, soft, hard = (float(count) for count in walls.sum(axis=0))
    met = hits + soft + hard
    score = 1.0 - OCCUPIED_WEIGHT * hard / (both + (OCCUPIED_WEIGHT - 1.0) * met) if both + met > 0.0 else 0.0
    centre = (float(area[1]) / both, float(area[2]) / both) if both > 0.0 else (0.0, 0.0)
    across = 0.5 * side * sum(float(eigenvalues([[xx, xy], [xy, yy]])[0]) for xx, xy, yy in facing)
    return Agreement(both * side**2, centre, 0.5 * hits * side, 0.5 * met * side, across, hard * side, score)


def why_refused(agreement: Agreement, settings: ValidationSettings) -> str | None:
    """Return why a transform is refused, or None if there is no objection.

    Rivals are not considered here.
    """
    if agreement.overlap_m2 < settings.least_overlap_m2:
        return f"small overlap: {agreement.overlap_m2:.1f} m2 known in both, want {settings.least_overlap_m2:g}"
    if has_contradiction(agreement, settings):
        allowed = _excused(agreement, settings)
        return (
            f"contradiction: {agreement.contradicting_m:.1f} m of walls stand where the other map is free, "
            f"at most {allowed:.1f} m may"
        )
    if agreement.hit_rate < settings.hit_rate:
        share, wanted = 100.0 * agreement.hit_rate, 100.0 * settings.hit_rate
        return f"contradiction: {share:.0f} % of the walls in the overlap agree, want {wanted:.0f} %"
    if agreement.agreeing_m < settings.least_wall_m:
        return f"small overlap: {agreement.agreeing_m:.1f} m of walls agree, want {settings.least_wall_m:g}"
    evidence_m = max(settings.least_evidence_m, settings.least_evidence_per_m2 * agreement.overlap_m2)
    if agreement.evidence_m < evidence_m:
        return f"small overlap: {agreement.evidence_m:.1f} m of walls speak for it, want {evidence_m:.3g}"
    across_m = max(settings.least_across_m, settings.least_across_share * agreement.agreeing_m)
    if agreement.across_m < across_m:
        return f"ambiguous: {agreement.across_m:.1f} m of walls hold the maps in one direction, want {across_m:.3g}"
    return None


def has_contradiction(agreement: Agreement, settings: ValidationSettings) -> bool:
    """Return whether more contradicts than is excused."""
    return agreement.contradicting_m > _excused(agreement, settings) or agreement.score < settings.score


def is_rival(agreement: Agreement, best: Agreement, settings: ValidationSettings) -> bool:
    """Return whether another transform explains the maps nearly as well.

    As many walls agree as under the best, and nothing contradicts.
    """
    return (
        agreement.overlap_m2 >= settings.least_overlap_m2
        and agreement.contradicting_m <= _excused(agreement, settings)
        and agreement.hit_rate >= settings.hit_rate
        and agreement.agreeing_m >= settings.rival_share * best.agreeing_m
    )


def _excused(agreement: Agreement, settings: ValidationSettings) -> float:
    """Return the length of walls that may contradict [m]."""
    if agreement.overlap_m2 < settings.plenty_of_overlap_m2:
        return settings.most_contradiction_m
    return settings.most_contradiction_m + settings.contradiction_share * max(
        agreement.wall_m - settings.plenty_of_wall_m, 0.0
    )


DIRECTIONS = 16
"""Directions in which walls face."""

APART_M, MIN_M = 0.12, 0.3
"""Gap between two walls that face one direction, and least length of a wall that agrees [m]."""


def _distinct_walls(a: DescribedMap, b: DescribedMap, a_from_b: Transform, hit_distance_m: float) -> int:
    """Return the number of distinct walls of map b that agree with walls of map a.

    A wall is all that faces one direction at one distance.

    Parameters
    ----------
    a, b : DescribedMap
        Maps of one resolution.
    a_from_b : Transform
        Maps points of b into a.
    hit_distance_m : float
        Distance within which walls agree [m], or within a cell and a half.
    """
    is_agreeing = _agreeing(a, b, a_from_b, max(hit_distance_m, 1.5 * a.resolution))
    has_side = np.hypot(*b.normals.T) > 0.7
    walls, normals = b.walls[is_agreeing & has_side], b.normals[is_agreeing & has_side]
    angles, step = np.arctan2(normals[:, 1], normals[:, 0]), 2.0 * math.pi / DIRECTIONS
    # Most walls of a building are at right angles: directions are counted from theirs, in whatever frame.
    first = float(np.angle(np.exp(4j * angles).sum())) / 4.0
    facing = np.round((angles - first) / step).astype(np.int64) % DIRECTIONS
    count = 0
    for direction in range(DIRECTIONS):
        angle = first + direction * step
        chosen = walls[facing == direction]
        distances = np.sort(chosen[:, 0] * math.cos(angle) + chosen[:, 1] * math.sin(angle))
        lengths = np.diff(np.flatnonzero(np.diff(distances) > APART_M), prepend=-1, append=len(distances) - 1)
        count += int(np.count_nonzero(lengths * b.resolution >= MIN_M - 1e-9))
    return count


def _agreeing(a: DescribedMap, b: DescribedMap, a_from_b: Transform, hit_m: float) -> NDArray[np.bool_]:
    """Return which walls of map b lie on walls of map a, (n,)."""
    cells = np.floor(a_from_b.apply(b.walls) / a.resolution).astype(np.int64)
    rows, columns = a.levels.shape
    is_inside = (cells >= 0).all(axis=1) & (cells[:, 0] < columns) & (cells[:, 1] < rows)
    agrees = np.zeros(len(cells), np.bool_)
    inside = cells[is_inside]
    agrees[is_inside] = a.distance[inside[:, 1], inside[:, 0]] <= hit_m
    return agrees


PLENTY_M2 = 30.0
"""From this overlap on, maps need know nothing else [m2]."""

PLENTY_OF_STRUCTURE_M2 = 45.0
"""From this overlap on, it does not count how many walls agree [m2]."""

MANY_WALLS, EXCUSED_M = 12, 0.1
"""Number of distinct walls that exclude chance; each further one excuses this contradiction [m]: bodies, doors."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Confirmation:
    """Conditions for acting on a merge.

    Attributes
    ----------
    validation : ValidationSettings or None
        Conditions on the agreement; by default (None) those for every pair.
    own_m2 : float
        Each map knows so much that the other one does not [m2], or both know `PLENTY_M2`, or `MANY_WALLS`
        agree: of what a map knows beyond the overlap nothing has contradicted, though in rooms that merely
        seem alike something would have.
    wall_m : float
        The walls that agree measure at most so much each in the mean [m], or both maps know
        `PLENTY_OF_STRUCTURE_M2`: long straight walls agree in corridors that are not one. Any length does
        where 0.
    """

    validation: ValidationSettings | None = None
    own_m2: float = 0.0
    wall_m: float = 0.0

    def convinces(
        self,
        maps: tuple[DescribedMap, DescribedMap],
        known_m2: float,
        a_from_b: Transform | None,
        agreement: Agreement,
    ) -> bool:
        """Return whether a pair convinces.

        Parameters
        ----------
        maps : (DescribedMap, DescribedMap)
            Maps a and b.
        known_m2 : float
            Known area of the smaller one [m2].
        a_from_b : Transform or None
            How b lies in a.
        agreement : Agreement
            Their evidence for that.
        """
        if a_from_b is None:
            return False
        if self == Confirmation():
            return True
        overlap_m2, validation = agreement.overlap_m2, self.validation or ValidationSettings()
        walls = _distinct_walls(*maps, a_from_b, validation.hit_distance_m)
        knows_more = known_m2 - overlap_m2 >= self.own_m2
        if not (knows_more or overlap_m2 >= PLENTY_M2 or walls >= MANY_WALLS):
            return False
        if self.validation is not None:
            excused_m = validation.most_contradiction_m + EXCUSED_M * max(walls - MANY_WALLS, 0)
            if why_refused(agreement, replace(validation, most_contradiction_m=excused_m)) is not None:
                return False
        has_structure = agreement.agreeing_m <= self.wall_m * walls
        return self.wall_m == 0.0 or overlap_m2 >= PLENTY_OF_STRUCTURE_M2 or has_structure
