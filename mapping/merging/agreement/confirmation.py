"""What maps must say of a pair beside being found when it joins them."""

from dataclasses import dataclass, replace

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.merging.agreement.distinct_walls import distinct_walls
from lidarium.mapping.merging.agreement.validation import Agreement, ValidationSettings, why_refused
from lidarium.mapping.merging.description.described_map import DescribedMap

PLENTY_M2 = 30.0
"""From this overlap on, maps need know nothing else [m2]."""

PLENTY_OF_STRUCTURE_M2 = 45.0
"""From this overlap on, it does not count how many walls agree [m2]."""

MANY_WALLS, EXCUSED_M = 12, 0.1
"""So many distinct walls are no chance; each beyond excuses so much contradiction [m]: bodies, doors."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Confirmation:
    """What convinces whoever acts on a merge.

    Attributes
    ----------
    validation : ValidationSettings or None
        What must hold of the agreement; nothing more than for every pair where None.
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
            What the one knows that knows less [m2].
        a_from_b : Transform or None
            How b lies in a.
        agreement : Agreement
            What they say of that.
        """
        if a_from_b is None:
            return False
        if self == Confirmation():
            return True
        overlap_m2, validation = agreement.overlap_m2, self.validation or ValidationSettings()
        walls = distinct_walls(*maps, a_from_b, validation.hit_distance_m)
        knows_more = known_m2 - overlap_m2 >= self.own_m2
        if not (knows_more or overlap_m2 >= PLENTY_M2 or walls >= MANY_WALLS):
            return False
        if self.validation is not None:
            excused_m = validation.most_contradiction_m + EXCUSED_M * max(walls - MANY_WALLS, 0)
            if why_refused(agreement, replace(validation, most_contradiction_m=excused_m)) is not None:
                return False
        has_structure = agreement.agreeing_m <= self.wall_m * walls
        return self.wall_m == 0.0 or overlap_m2 >= PLENTY_OF_STRUCTURE_M2 or has_structure
