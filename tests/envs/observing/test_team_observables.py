"""Time, coverage and teammates as functions of rows."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from lidarium.envs.observing.observables import TEAMMATES, coverage, teammate_box, teammates, time_left
from lidarium.envs.settings.making import make_settings


def test_time_that_is_left_is_a_share_of_the_horizon():
    settings = make_settings(robots=2, horizon_s=10.0)
    rows = SimpleNamespace(settings=settings, time_s=np.array([0.0, 2.5, 10.0, 10.0]), robots=2, episodes=2)
    assert time_left(rows)[:, 0].tolist() == pytest.approx([1.0, 0.75, 0.0, 0.0])
    endless = SimpleNamespace(settings=make_settings(robots=2, horizon_s=None), robots=2, episodes=2)
    assert time_left(endless).tolist() == [[1.0]] * 4


def test_places_of_teammates_are_seen_from_the_robot_where_they_are_known():
    table = np.zeros((2, 2, 8))
    table[0, 0] = (5.0, 6.0, 1.0, 7.0, 8.0, 1.0, 0.0, 1.0)
    table[0, 1] = (5.0, 6.0, 1.0, 0.0, 0.0, 0.0, 3.0, 1.0)
    rows = SimpleNamespace(teammates=table, pose=np.array([(1.0, 2.0, 0.0), (9.0, 9.0, 0.0)]))
    found = teammates(rows)
    assert found[0, 0].tolist() == [4.0, 4.0, 1.0, 6.0, 6.0, 1.0, 0.0, 1.0]
    assert found[0, 1].tolist() == [4.0, 4.0, 1.0, 0.0, 0.0, 0.0, 3.0, 1.0]
    assert not found[1].any()


def test_the_space_has_a_row_for_each_of_the_others():
    box = teammate_box(make_settings(robots=4))
    assert box.shape == (3, 8)
    assert box.contains(np.tile(np.float32([1, 2, math.pi, 3, 4, 1, 9, 1]), (3, 1)))
    assert not box.contains(np.tile(np.float32([1, 2, 3, 3, 4, 1, -1, 1]), (3, 1)))
    assert TEAMMATES.missing(make_settings(robots=1)) == "two robots or more"
    assert TEAMMATES.missing(make_settings(robots=2)) == ""


def test_coverage_is_a_column():
    assert coverage(SimpleNamespace(coverage=np.array([0.1, 0.2]))).tolist() == [[0.1], [0.2]]
