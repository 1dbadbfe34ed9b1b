"""Whether two overlaid maps show one place.

The default test counts what both maps know: walls that lie on walls, and walls of one that stand where the
other has observed and found nothing. A transform is refused where too little agrees, where enough
contradicts, or where another transform explains the maps nearly as well. The disc test of the thesis compares
cells around the inliers only, unknown ones included.
"""

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.bounds import Distance, FromZero, Turn, check_settings, share, within
from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.merging.agreement.counts import WallField, count_overlap, count_walls, pose_numbers
from lidarium.mapping.merging.description.described_map import DescribedMap

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
        straight corridors agree wherever they are overlaid.
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
    """What two overlaid maps say of the transform.

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
    """Compare map b with map a under a transform.

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
    for k, (field_of, walls_of, transform) in enumerate(((a, b, a_from_b), (b, a, b_from_a))):
        field = WallField(field_of.levels, field_of.distance, field_of.is_open, 1.0 / side, hit, miss)
        count_walls(field, walls_of.walls, walls_of.normals, pose_numbers(transform), walls[k], facing[k])
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
    count_overlap(a.levels, b.levels, side, pose_numbers(a_from_b), area)
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
