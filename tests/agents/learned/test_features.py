"""Features for a trained explorer."""

import math

import numpy as np
import pytest

from lidarium.agents.learned.features import (
    MOST,
    OPTION_FEATURES,
    SITUATION_FEATURES,
    TEAMMATE_FEATURES,
    _in_frame,
    far_gains,
    table_of,
    teammate_features,
)
from lidarium.agents.tours.planning import Tourist

POSE = np.array([2.0, 1.0, math.pi / 2])


def test_places_are_seen_ahead_and_to_the_left():
    ahead, left = _in_frame(np.array([[2.0, 4.0], [0.0, 1.0], [3.0, 1.0]]), POSE)
    np.testing.assert_allclose(ahead, [3.0, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(left, [0.0, 2.0, -1.0], atol=1e-12)


def test_moving_and_rotating_all_changes_nothing():
    generator = np.random.default_rng(0)
    places, angle, shift = generator.normal(size=(20, 2)), 1.3, np.array([5.0, -3.0])
    rotation = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    moved = np.append(rotation @ POSE[:2] + shift, POSE[2] + angle)
    for one, other in zip(_in_frame(places, POSE), _in_frame(places @ rotation.T + shift, moved), strict=True):
        np.testing.assert_allclose(one, other, atol=1e-12)


def test_a_table_is_divided_by_scales_and_bounded():
    values = {"b": np.array([-1e9, 1.0]), "a": np.array([1.0, 2.0])}
    table = table_of(values, {"a": 2.0, "b": 10.0})
    assert table.dtype == np.float32
    np.testing.assert_allclose(table, [[0.5, -MOST], [1.0, 0.1]])


def test_a_feature_that_is_missing_is_an_error():
    with pytest.raises(KeyError, match="left"):
        table_of({"ahead": np.zeros(2)}, {"ahead": 1.0, "left": 1.0})


def test_scales_are_positive():
    for scales in (OPTION_FEATURES, TEAMMATE_FEATURES, SITUATION_FEATURES):
        assert all(scale > 0.0 for scale in scales.values())


def test_teammates_are_seen_with_what_they_drive_to():
    first = Tourist(np.array([2.0, 3.0, math.pi / 2]))
    second = Tourist(np.array([0.0, 1.0, -math.pi / 2]))
    seen = teammate_features([(first, np.array([1.0, 3.0]), True), (second, None, False)], POSE)
    assert set(seen) == set(TEAMMATE_FEATURES)
    expected = {
        "ahead": [2.0, 0.0],
        "left": [0.0, 2.0],
        "cosine": [1.0, -1.0],
        "sine": [0.0, 0.0],
        "has_target": [1.0, 0.0],
        "target_ahead": [2.0, 0.0],
        "target_left": [1.0, 0.0],
        "has_picked": [1.0, 0.0],
    }
    for name, values in expected.items():
        np.testing.assert_allclose(seen[name], values, atol=1e-12, err_msg=name)


def test_who_is_alone_sees_no_teammates():
    table = table_of(teammate_features([], POSE), TEAMMATE_FEATURES)
    assert table.shape == (0, len(TEAMMATE_FEATURES))


def test_gains_lie_where_the_map_is_unknown():
    log_odds = np.zeros((80, 160), np.int8)
    log_odds[20:60, :80] = -20  # free to the left, unknown to the right
    gains, directions = far_gains(log_odds, 0.1, np.array([[40, 78], [40, 8]]), 5.6)
    assert gains[0] > gains[1]
    assert directions[0] == pytest.approx(0.0, abs=0.05)
    assert gains[0] > 20.0


def test_no_cells_show_nothing():
    gains, directions = far_gains(np.zeros((5, 5), np.int8), 0.1, np.zeros((0, 2), np.int64), 5.6)
    assert gains.shape == directions.shape == (0,)
