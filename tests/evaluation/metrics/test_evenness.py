"""How evenly work is shared."""

import numpy as np
import pytest

from lidarium.evaluation import metrics


def test_balance_is_the_spread_of_the_shares():
    assert metrics.balance(np.array([0.2, 0.4])) == pytest.approx(0.1)
    assert metrics.path_balance(np.array([10.0, 30.0])) == pytest.approx(0.5)
    assert metrics.path_balance(np.zeros(3)) == 0.0


def test_jain_index_tells_how_evenly_work_is_shared():
    assert metrics.jain_index([5.0, 5.0, 5.0, 5.0]) == pytest.approx(1.0)
    assert metrics.jain_index([5.0, 0.0, 0.0, 0.0]) == pytest.approx(0.25)
    assert metrics.jain_index([0.0, 0.0]) == 1.0
