"""Errors of tracks."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lidarium.evaluation.metrics import poses


def drive(generator, steps=60):
    """A wandering track of poses (steps, 3)."""
    theta = np.cumsum(generator.normal(0.0, 0.2, steps))
    ways = 0.1 * np.stack([np.cos(theta), np.sin(theta)], axis=1)
    return np.column_stack([np.cumsum(ways, axis=0), theta])


@given(st.floats(-3.0, 3.0), st.floats(-50.0, 50.0), st.integers(0, 2**32 - 1))
def test_a_track_in_another_frame_has_no_error_once_aligned(theta, x, seed):
    true = drive(np.random.default_rng(seed))
    believed = poses.moved(true, np.array([x, -0.5 * x, theta]))
    assert poses.absolute_error(believed, true) == pytest.approx(0.0, abs=1e-9)
    assert poses.relative_error(believed, true, 10) == pytest.approx((0.0, 0.0), abs=1e-9)
    assert poses.moved(believed, poses.best_transform(believed, true))[:, :2] == pytest.approx(true[:, :2], abs=1e-9)


def test_absolute_error_is_the_root_mean_square_of_what_alignment_leaves():
    true = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [4.0, 0.0, 0.0]])
    believed = true + np.array([[0.0, 3.0, 0.0]])
    assert poses.absolute_error(believed, true, is_aligned=False) == 3.0
    assert poses.absolute_error(believed, true) == pytest.approx(0.0, abs=1e-12)
    stretched = true * np.array([1.5, 1.0, 1.0])
    # Aligned at the middle, the ends are 1 m off: sqrt((1 + 0 + 1) / 3). Scale is not taken out.
    assert poses.absolute_error(stretched, true) == pytest.approx(np.sqrt(2 / 3))


def test_relative_error_is_that_of_the_motions():
    true = np.array([[0.0, 0.0, np.pi / 2], [0.0, 1.0, np.pi / 2], [0.0, 2.0, np.pi / 2]])
    believed = np.array([[0.0, 0.0, 0.0], [1.1, 0.0, 0.1], [2.2, 0.11, 0.1]])
    translation, rotation = poses.relative_error(believed, true, 1)
    first, second = (
        (0.1, 0.0),
        (1.1 * np.cos(0.1) + 0.11 * np.sin(0.1) - 1.0, 0.11 * np.cos(0.1) - 1.1 * np.sin(0.1)),
    )
    assert translation == pytest.approx(np.sqrt((np.dot(first, first) + np.dot(second, second)) / 2))
    assert rotation == pytest.approx(0.05)
    assert poses.relative_error(believed, true, 3) is None


def test_the_best_transform_is_no_worse_than_any_other():
    generator = np.random.default_rng(3)
    true = drive(generator)
    believed = poses.moved(true, np.array([1.0, 2.0, 0.7])) + generator.normal(0.0, 0.05, true.shape)
    best = poses.best_transform(believed, true)
    least = poses.absolute_error(believed, true)
    for change in np.vstack([np.eye(3), -np.eye(3)]) * 1e-3:
        assert poses.absolute_error(poses.moved(believed, best + change), true, is_aligned=False) > least
