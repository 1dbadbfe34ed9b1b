"""Criteria for joining the maps of a team's robots: two matches as `lidarium merge` finds them.

Maps of a few rooms from a short exploration can match by accident, and joined robots act on the result at once. A
match is therefore repeated on grown maps, with stricter criteria.
"""

from lidarium.mapping.merging.agreement import Confirmation, ValidationSettings

TEAM_CONFIRMATION = ValidationSettings(
    least_overlap_m2=8.0, most_contradiction_m=0.3, least_across_share=0.2, least_evidence_per_m2=0.3
)
"""Validation settings for merges by which robots are led.

Rooms of one plan, corridors and halls agree well enough to be found, but hardly ever so well.
"""

GROWTH_M2, OWN_M2, WALL_M = 2.0, 6.0, 3.5
"""Additional area at the second match, area known to each map alone [m2], mean length of a wall [m]."""


def team_confirmation(
    own_m2: float = OWN_M2, wall_m: float = WALL_M, validation: ValidationSettings | None = TEAM_CONFIRMATION
) -> Confirmation:
    """Return the confirmation that a team requires; see `Confirmation`."""
    return Confirmation(validation=validation, own_m2=own_m2, wall_m=wall_m)
