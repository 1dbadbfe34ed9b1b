"""What convinces a team that maps are of one place."""

from lidarium.envs.onboard.station.joining import OWN_M2, TEAM_CONFIRMATION, WALL_M, team_confirmation
from lidarium.mapping.merging.agreement import ValidationSettings


def test_a_team_asks_for_more_than_a_pair_of_maps():
    usual, found = ValidationSettings(), team_confirmation()
    assert (found.validation, found.own_m2, found.wall_m) == (TEAM_CONFIRMATION, OWN_M2, WALL_M)
    assert found.validation.least_overlap_m2 > usual.least_overlap_m2


def test_nothing_more_may_be_asked_for():
    found = team_confirmation(0.0, 0.0, None)
    assert (found.validation, found.own_m2, found.wall_m) == (None, 0.0, 0.0)
