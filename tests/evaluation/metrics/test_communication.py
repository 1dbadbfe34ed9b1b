"""Links, bytes and lags of a team."""

import numpy as np
import pytest

from lidarium.evaluation.metrics import communication

LINKS = np.array(
    [
        [[1, 1, 0, 0], [1, 1, 1, 0], [0, 1, 1, 1], [0, 0, 1, 1]],  # a chain
        [[1, 1, 0, 0], [1, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]],  # two together, two alone
        [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]],  # nobody reaches anybody
        [[1, 1, 0, 0], [0, 1, 1, 0], [0, 0, 1, 1], [0, 0, 0, 1]],  # a chain of which each link goes one way
    ],
    bool,
)


def test_a_team_is_connected_while_all_are_one_cluster():
    assert communication.largest_clusters(LINKS).tolist() == [4, 2, 1, 4]
    assert communication.connected_share(LINKS) == 0.5
    assert communication.largest_cluster_share(LINKS) == pytest.approx((4 + 2 + 1 + 4) / 16)
    assert communication.connected_share(LINKS[:0]) == communication.largest_cluster_share(LINKS[:0]) == 1.0


def test_bytes_are_told_by_robot_and_second():
    assert communication.bytes_per_robot_second([600, 0, 300], 10.0) == 30.0
    assert communication.bytes_per_robot_second([600], 0.0) == 0.0


def test_sharing_lags_by_what_the_last_robot_needs_to_know_what_the_team_knows():
    times, team = [0.0, 10.0, 20.0, 30.0], [0.5, 0.99, 1.0, 1.0]
    own = np.array([[0.5, 0.4], [0.99, 0.5], [1.0, 0.8], [1.0, 0.99]])
    assert communication.sharing_lag(times, own, team) == 20.0
    assert communication.sharing_lag(times, own[:3], team[:3]) is None
