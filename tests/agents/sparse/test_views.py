"""Which borders of unknown ground are left to a robot, and how it sees."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from lidarium.agents.sparse.views import FACING, ViewSettings, _are_within, apart_from, discs_around

BORDER = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [3.0, 0.0]])


def sight(half_angle=0.5, nearest_m=0.6, farthest_m=3.0):
    camera = SimpleNamespace(
        nearest_m=nearest_m,
        farthest_m=farthest_m,
        half_angle=half_angle,
        bearing=0.2,
        highest_m=0.1,
        height_m=0.5,
    )
    robot = SimpleNamespace(cruise_speed=0.5, max_turn_rate=2.0)
    return ViewSettings(near_share=0.5).sight_of(
        SimpleNamespace(sparse_map=SimpleNamespace(camera=camera), robot=robot)
    )


def test_points_lie_within_discs_up_to_their_borders():
    discs = np.array([[1.0, 0.0, 1.0], [9.0, 9.0, 0.1]])
    assert _are_within(BORDER, discs).tolist() == [True, True, True, False]
    assert not _are_within(BORDER, np.empty((0, 3))).any()
    np.testing.assert_array_equal(discs_around(BORDER[:1], 0.3), [[0.0, 0.0, 0.3]])


def test_borders_lose_what_is_taken_and_go_when_nothing_is_left():
    left = apart_from([BORDER, BORDER[:2]], discs_around(BORDER[:2], 0.2))
    assert len(left) == 1
    np.testing.assert_array_equal(left[0], BORDER[2:])


def test_a_robot_sees_from_a_little_farther_on_towards_its_sides():
    seen = sight()
    assert seen.nearest == pytest.approx(0.6 / math.cos(0.5))
    assert seen.near == pytest.approx(0.5 * (seen.nearest + 3.0))
    assert seen.half_angle == pytest.approx(0.5 - FACING)
    assert seen.turn_cost == pytest.approx(0.25)


def test_a_narrow_or_a_short_sight_leaves_something_to_see():
    assert sight(half_angle=0.2).half_angle == pytest.approx(0.1)
    seen = sight(half_angle=1.5)
    assert seen.nearest == seen.near == seen.farthest == 3.0


@pytest.mark.parametrize("wrong", [{"near_share": 0.0}, {"minimum_size": 0.0}, {"gain": -1.0}])
def test_settings_that_make_no_sense_are_refused(wrong):
    with pytest.raises(ValueError, match="of views is"):
        ViewSettings(**wrong)
