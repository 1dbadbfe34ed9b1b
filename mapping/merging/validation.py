"""Whether two maps, laid over each other, tell of one place.

The default test counts what both maps know: walls that lie on walls, and walls of one that stand where the
other has looked and found nothing. A transform is refused where too little agrees, where enough contradicts,
or where another transform explains the maps nearly as well. The disc test of the thesis looks at cells around
the inliers only, unknown ones included.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.checks import check_from_zero
from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.grids.occupancy import FREE, UNKNOWN
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.merging.description.described_map import FACING_DISTANCE_M, DescribedMap, faces_away

OCCUPIED_WEIGHT = 10.0
"""How much more an occupied cell counts than a free one in the score."""

STRIDE = 3
"""Areas are counted on every so many-th cell."""

TESTS = ("walls", "discs")


@dataclass(frozen=True, slots=True, kw_only=True)
class ValidationSettings:
    """When a transform is believed.

    Attributes
    ----------
    test : str
        ``walls``: over all that both maps know; ``discs``: cells around the inliers, of the thesis.
    hit_distance_m : float
        A wall agrees where the other map has one within this distance [m], or within a cell and a half.
    miss_distance_m : float
        A wall contradicts where it stands in the open of the other map, farther than this from any wall [m].
    least_overlap_m2 : float
        Least area that both know [m2].
    least_wall_m : float
        Least length of walls that agree [m].
    least_evidence_m : float
        Least length of walls that agree, less that of walls that do not and three times that of walls that
        contradict [m].
    least_across_m : float
        Least length of walls that hold the maps in the direction in which they are held least [m]: two
        straight corridors agree wherever they are laid over each other.
    least_across_share : float
        The same as a share of the walls that agree, which is at most a half: along a corridor hardly any
        walls hold.
    least_evidence_per_m2 : float
        Least evidence on each square metre that both know [m/m2]: open floor agrees with open floor anywhere.
    hit_rate : float
        Least share of the walls in the overlap that agree.
    score : float
        Least score.
    most_contradiction_m : float
        Length of contradicting walls that is excused [m].
    plenty_of_overlap_m2, plenty_of_wall_m, contradiction_share : float
        Where both know so much [m2], of the walls beyond this length [m] this share may contradict too: maps
        of whole buildings drift.
    rival_distance_m, rival_angle : float
        A transform is another one where it differs by more than this [m, rad].
    rival_share : float
        A rival that nothing contradicts makes the best transform ambiguous where the walls that agree under
        it are longer than this share of those under the best.
    rival_lead : float
        A rival that is refused still speaks against the best transform where so many times more wall speaks
        for it.
    disc_radius_cells : int
        Radius of the discs [cells].
    disc_agreement : float
        Least share of cells in the discs that are the same in both maps.
    """

    test: str = "walls"
    hit_distance_m: float = 0.075
    miss_distance_m: float = 0.175
    least_overlap_m2: float = 5.0
    least_wall_m: float = 3.0
    least_evidence_m: float = 3.5
    least_across_m: float = 0.4
    least_across_share: float = 0.0
    least_evidence_per_m2: float = 0.0
    hit_rate: float = 0.7
    score: float = 0.9
    most_contradiction_m: float = 0.15
    plenty_of_overlap_m2: float = 250.0
    plenty_of_wall_m: float = 200.0
    contradiction_share: float = 0.1
    rival_distance_m: float = 0.5
    rival_angle: float = math.radians(5.0)
    rival_share: float = 0.6
    rival_lead: float = 1.5
    disc_radius_cells: int = 25
    disc_agreement: float = 0.90

    def __post_init__(self) -> None:
        if self.test not in TESTS:
            raise ValueError(f"test of validation is {self.test!r}; want one of {', '.join(TESTS)}")
        for name in (
            "least_across_share",
            "hit_rate",
            "score",
            "contradiction_share",
            "rival_share",
            "disc_agreement",
        ):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise ValueError(f"{name} of validation is {getattr(self, name)}; want 0 to 1")
        least = ("least_overlap_m2", "least_wall_m", "least_evidence_m", "least_across_m")
        lengths = (
            "hit_distance_m",
            "miss_distance_m",
            "most_contradiction_m",
            "plenty_of_wall_m",
            "rival_distance_m",
            "rival_lead",
        )
        check_from_zero(
            self, "validation", (*least, *lengths, "least_evidence_per_m2", "plenty_of_overlap_m2")
        )
        if self.disc_radius_cells < 1:
            raise ValueError(f"disc_radius_cells is {self.disc_radius_cells}; want one or more")


@dataclass(frozen=True, slots=True)
class Agreement:
    """What two maps laid over each other say of the transform.

    Attributes
    ----------
    overlap_m2 : float
        Area known in both [m2].
    centre : (x, y)
        Its centroid in map b [m].
    agreeing_m : float
        Length of walls that lie on walls, mean of both maps [m].
    wall_m : float
        Length of walls within what the other map knows, mean of both maps [m].
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
    score: float = 0.0

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
    """Lay map b over map a.

    Parameters
    ----------
    a, b : DescribedMap
        Maps of one resolution.
    a_from_b : Transform
        Maps points of b into a.
    settings : ValidationSettings
        Which distances agree and contradict.

    Returns
    -------
    Agreement
        What agrees and what does not, whatever map is called a.
    """
    side = a.resolution
    hit, miss = max(settings.hit_distance_m, 1.5 * side), max(settings.miss_distance_m, 2.5 * side)
    b_from_a = a_from_b.inverse()
    walls, facing = np.zeros((2, 3), np.int64), np.zeros((2, 3))
    _count_walls(
        a.levels,
        a.distance,
        a.is_open,
        1.0 / side,
        b.walls,
        b.normals,
        _pose(a_from_b),
        hit,
        miss,
        walls[0],
        facing[0],
    )
    _count_walls(
        b.levels,
        b.distance,
        b.is_open,
        1.0 / side,
        a.walls,
        a.normals,
        _pose(b_from_a),
        hit,
        miss,
        walls[1],
        facing[1],
    )
    area = np.zeros(3)
    _count_overlap(a.levels, b.levels, side, _pose(a_from_b), area)
    both = float(area[0])
    hits, soft, hard = (float(count) for count in walls.sum(axis=0))
    met = hits + soft + hard
    score = 1.0 - OCCUPIED_WEIGHT * hard / (both + (OCCUPIED_WEIGHT - 1.0) * met) if both + met > 0.0 else 0.0
    centre = (float(area[1]) / both, float(area[2]) / both) if both > 0.0 else (0.0, 0.0)
    across = 0.5 * side * sum(float(np.linalg.eigvalsh([[xx, xy], [xy, yy]])[0]) for xx, xy, yy in facing)
    return Agreement(both * side**2, centre, 0.5 * hits * side, 0.5 * met * side, across, hard * side, score)


def why_refused(agreement: Agreement, settings: ValidationSettings) -> str | None:
    """Return why a transform is refused, or None where there is no objection.

    Rivals are not considered here.
    """
    if agreement.overlap_m2 < settings.least_overlap_m2:
        return (
            f"small overlap: {agreement.overlap_m2:.1f} m2 known in both, want {settings.least_overlap_m2:g}"
        )
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
        return (
            f"ambiguous: {agreement.across_m:.1f} m of walls hold the maps in one direction, want "
            f"{across_m:.3g}"
        )
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


def disc_agreement(
    a: DescribedMap, b: DescribedMap, a_from_b: Transform, points: NDArray[np.float64], radius_cells: int
) -> float:
    """Return the share of map b's cells within discs whose state in map a agrees.

    The discs are around points [m of map b].

    Unknown is a state as others are; what lies outside of map a is unknown. A cell in several discs counts
    once.
    """
    if len(points) == 0:
        return 0.0
    is_inside = np.zeros(b.levels.shape, np.bool_)
    counts = np.zeros(2, np.int64)
    _count_discs(a.levels, b.levels, a.resolution, _pose(a_from_b), points, radius_cells, is_inside, counts)
    return float(counts[0]) / float(counts[1]) if counts[1] else 0.0


def _pose(transform: Transform) -> tuple[float, float, float]:
    return transform.x, transform.y, transform.theta


@kernel
def _count_walls(
    levels: Array,
    distance: Array,
    is_open: Array,
    scale: float,
    walls: Array,
    normals: Array,
    pose: tuple[float, float, float],
    hit: float,
    miss: float,
    counts: Array,
    facing: Array,
) -> None:
    """Count the walls that agree, that miss by little, and that contradict.

    Sum the squares of the normals of those that agree.
    """
    rows, columns = levels.shape
    cosine, sine = math.cos(pose[2]) * scale, math.sin(pose[2]) * scale
    x0, y0 = pose[0] * scale, pose[1] * scale
    for i in range(walls.shape[0]):
        column = cosine * walls[i, 0] - sine * walls[i, 1] + x0
        row = sine * walls[i, 0] + cosine * walls[i, 1] + y0
        x, y = int(math.floor(column)), int(math.floor(row))
        if 0 <= x < columns and 0 <= y < rows:
            if distance[y, x] <= hit:
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
                counts[2 if is_open[y, x] != 0 and distance[y, x] > miss else 1] += 1


@kernel
def _count_overlap(a: Array, b: Array, side: float, pose: tuple[float, float, float], found: Array) -> None:
    """Count the cells known in both maps, and find their centroid in b [m].

    Every so many-th cell of every so many-th row is examined.
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
                if (
                    is_inside[row, column]
                    or (row - middle_row) ** 2 + (column - middle_column) ** 2 > radius * radius
                ):
                    continue
                is_inside[row, column] = True
                x = cosine * (column + 0.5) - sine * (row + 0.5) + pose[0] / side
                y = sine * (column + 0.5) + cosine * (row + 0.5) + pose[1] / side
                c, r = int(math.floor(x)), int(math.floor(y))
                state = a[r, c] if 0 <= c < a.shape[1] and 0 <= r < a.shape[0] else np.uint8(UNKNOWN)
                counts[0] += np.int64(state == b[row, column])
                counts[1] += 1
