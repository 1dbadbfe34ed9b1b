"""What robots believe, and what of it has changed."""

import numpy as np
import pytest
from seen_truth import NEAR, begun


@pytest.mark.parametrize("known_starts", [True, False])
def test_a_robot_believes_to_be_where_it_started(known_starts):
    env = begun(known_starts=known_starts)
    assert env.beliefs.believed == pytest.approx(NEAR if known_starts else np.zeros((2, 3)))
    for row, log_odds in enumerate(env.beliefs.log_odds):
        x, y = (env.beliefs.believed[row, :2] - env.beliefs.origins[row]) / env.settings.occupancy.resolution
        assert log_odds[int(y), int(x)] < 0


def test_a_map_that_is_wiped_is_blank_and_rendered_once_more():
    env = begun(known_starts=False)
    other = env.beliefs.log_odds[1].copy()
    env.beliefs.wipe(0)
    assert not env.beliefs.log_odds[0].any()
    assert np.array_equal(env.beliefs.log_odds[1], other)
    assert env.beliefs.renderings.tolist() == [1, 0]


def test_cells_that_are_forgotten_are_within_the_window_of_changes():
    env = begun(known_starts=False)
    beliefs = env.beliefs
    beliefs.forget_changes(0, 2)
    known = np.argwhere(beliefs.log_odds[0] != 0)
    row, column = (int(side) for side in known[len(known) // 2])
    before = beliefs.log_odds[0].copy()
    where = np.array([[True, False], [False, False]])
    beliefs.forget(0, where, (row, column))
    assert beliefs.log_odds[0][row, column] == 0
    before[row, column] = 0
    assert np.array_equal(beliefs.log_odds[0], before)
    low_row, high_row, low_column, high_column = beliefs.windows[0]
    assert low_row <= row < high_row
    assert low_column <= column < high_column
    assert beliefs.windows[1].tolist() == [beliefs.log_odds[1].shape[0], 0, beliefs.log_odds[1].shape[1], 0]


def test_kernels_find_the_maps_where_they_lie():
    beliefs = begun().beliefs
    for row, log_odds in enumerate(beliefs.log_odds):
        assert beliefs.belief_rows[row, :3].tolist() == [log_odds.ctypes.data, *log_odds.shape]
