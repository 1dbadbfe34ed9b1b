"""Reasons for which a map is probably wrong."""

import math

import numpy as np
import pytest
from driven_rooms import through

from lidarium.mapping.geometry.rigid import composed, relative
from lidarium.mapping.localization.slam.verdict import reasons_to_doubt

POINTS = [(1.0, 1.0), (5.0, 1.0), (5.0, 4.0), (2.0, 3.0), (1.0, 1.0), (5.0, 2.0)]


@pytest.fixture(scope="module")
def path():
    return through(POINTS)


def reasons(poses, odometry, doubtful=0, restarts=0):
    return reasons_to_doubt(poses, odometry, doubtful, len(poses), restarts)


def test_nothing_is_doubted_if_odometry_errs_as_wheels_do(path):
    noise = np.random.default_rng(0).normal(0.0, [0.005, 0.005, 0.005], path.shape)
    motions = relative(path[:-1], path[1:]) * [1.05, 1.0, 0.96]
    odometry = [path[0]]
    for motion in motions:
        odometry.append(composed(odometry[-1], motion))
    assert reasons(path + noise, np.array(odometry)) == []
    assert reasons(path, None) == []


def test_many_doubtful_scans_or_a_lost_robot_are_reasons(path):
    assert reasons(path, path, doubtful=len(path) // 50) == []
    assert reasons(path, path, doubtful=len(path) // 10) == [f"{len(path) // 10} of {len(path)} scans are doubtful"]
    assert "lost 1 times" in reasons(path, None, restarts=1)[0]


@pytest.mark.parametrize("scale", [0.7, 1.4])
def test_other_lengths_and_turns_are_reasons(path, scale):
    (found,) = reasons(path * [scale, scale, 1.0], path)
    assert f"lengths by scans are {scale:.2f}" in found
    turns = path.copy()
    turns[:, 2] *= scale
    assert f"turns by scans are {scale:.2f}" in " ".join(reasons(turns, path))


def test_a_laser_that_is_mounted_otherwise_is_a_reason(path):
    turned = composed(path, np.array([0.0, 0.0, math.pi / 2]))
    assert reasons(turned, path) == [
        "by scans the robot moves -90 degrees away from its direction by odometry: the laser is mounted otherwise"
    ]
    ahead = composed(path, np.array([0.8, 0.0, 0.0]))
    assert "moves aside where it turns" in reasons(ahead, path)[0]


def test_unknown_odometry_is_not_compared(path):
    odometry, poses = path.copy(), path.copy()
    odometry[20:30] = np.nan
    poses[20:] = composed(np.array([3.0, 2.0, 1.0]), poses[20:])
    assert reasons(poses, odometry) == []
    assert reasons(poses, np.full_like(path, np.nan)) == []
