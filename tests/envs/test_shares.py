"""Shares of what a robot can do become speeds."""

import numpy as np
import pytest

from lidarium.envs.levels.shares import scale_shares


def test_shares_are_cut_to_1_and_scaled_by_the_limits_of_their_robot():
    limits = np.array([0.5, 2.0, 0.25, 4.0])
    commands = np.array([[1.0, -1.0], [3.0, -0.5], [0.0, 9.0], [-7.0, 0.25]])
    assert scale_shares(commands, limits)
    assert commands.tolist() == [[0.5, -2.0], [0.25, -2.0], [0.0, 2.0], [-0.25, 1.0]]


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_what_is_no_number_is_found(bad):
    assert not scale_shares(np.array([[0.0, 0.0], [0.0, bad]]), np.array([0.5, 2.0]))
