"""Spaces of observations are bounded, in the order of what is observed."""

import math

import numpy as np
import pytest

from lidarium.envs.observing.spaces import (
    KERNEL_SUMMARIES,
    action_space,
    boxes_of,
    observation_space,
    observed_keys,
)
from lidarium.envs.settings.limits import GAINS, OBSERVABLES
from lidarium.envs.settings.making import make_settings


@pytest.mark.parametrize("has_goal", [True, False])
def test_a_goal_is_observed_where_the_floor_has_one(has_goal):
    settings = make_settings(robots=2, observe=("scan", "coverage", "pose", "frontier_gains"))
    assert observed_keys(settings, has_goal) == ("scan", "pose", *(["goal"] * has_goal))
    assert set(observation_space(settings, has_goal).spaces) == {
        "scan",
        "pose",
        "coverage",
        *(["goal"] * has_goal),
    }


def test_every_box_is_bounded_and_has_the_size_of_the_settings():
    settings = make_settings(
        robots=3, map_cells=64, egocentric_cells=32, egocentric_scales=(1, 4), lidar="lidar_360_6m"
    )
    boxes = boxes_of(settings)
    assert all(np.isfinite(box.low).all() and np.isfinite(box.high).all() for box in boxes.values())
    assert boxes["scan"].shape == (180,)
    assert boxes["scan"].high.max() == np.float32(6.0)
    assert boxes["map"].shape == (1, 64, 64)
    assert boxes["egocentric_map"].shape == (2, 32, 32)


def test_headings_that_are_rounded_up_from_pi_are_in_the_space():
    box = boxes_of(make_settings(robots=1))["pose"]
    for theta in (math.pi, -math.pi):
        assert box.contains(np.array([0.0, 0.0, theta], np.float32))
    assert not box.contains(np.array([0.0, 0.0, 3.15], np.float32))


def test_limits_of_a_team_are_those_of_its_fastest_robot():
    settings = make_settings(robots=1)
    assert boxes_of(settings)["velocity"].high == pytest.approx(settings.speed_limits.max(axis=0), rel=1e-6)
    assert action_space().shape == (2,)


def test_all_that_kernels_write_has_a_line():
    assert set(KERNEL_SUMMARIES) == {*OBSERVABLES, GAINS}
