import numpy as np
import pytest

from lidarium.mapping.localization.matching.local_matching import outweighs
from lidarium.mapping.localization.matching.scan_matching import Match

BETTER_BY = 0.1


def match_of(score, overlap):
    return Match(np.zeros(3), score, overlap, 0.0, np.eye(3), np.zeros((3, 3)))


@pytest.mark.parametrize(("score", "is_believed"), [(0.45, False), (0.55, True), (0.8, True)])
def test_odometry_is_given_up_only_for_a_match_that_is_clearly_better(score, is_believed):
    assert outweighs(match_of(score, 1.0), match_of(0.4, 1.0), BETTER_BY) == is_believed


def test_part_of_a_scan_that_agrees_better_does_not_outweigh_all_of_it():
    # As it was at the corner of a hall, where the part lay on the other side of a wall of 0.2 m.
    near, far = match_of(0.43, 0.92), match_of(0.56, 0.64)
    assert not outweighs(far, near, BETTER_BY)
    assert outweighs(match_of(0.56, 0.92), near, BETTER_BY)
