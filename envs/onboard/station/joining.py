"""When the maps of a team's robots are joined: as `lidarium merge` finds them, and twice.

Maps of a few rooms that robots have just begun can agree without being of one place, and who is joined acts
on it at once. So what was found is found once more on maps that have grown, and has to convince.
"""

from lidarium.mapping.merging.agreement import Confirmation, ValidationSettings

TEAM_CONFIRMATION = ValidationSettings(
    least_overlap_m2=8.0, most_contradiction_m=0.3, least_across_share=0.2, least_evidence_per_m2=0.3
)
"""Validation settings for merges by which robots are led.

Rooms of one plan, corridors and halls agree well enough to be found, but hardly ever so well.
"""

GROWTH_M2, OWN_M2, WALL_M = 2.0, 6.0, 3.5
"""What maps know more at the second finding, what each knows alone [m2], mean length of a wall [m]."""


def team_confirmation(
    own_m2: float = OWN_M2, wall_m: float = WALL_M, validation: ValidationSettings | None = TEAM_CONFIRMATION
) -> Confirmation:
    """Return what convinces a team; see `Confirmation`."""
    return Confirmation(validation=validation, own_m2=own_m2, wall_m=wall_m)
