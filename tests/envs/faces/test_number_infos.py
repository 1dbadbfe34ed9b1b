"""Infos as numbers under the same names."""

import numpy as np

from lidarium.envs.faces.conventions import ending_number, flat_row_infos
from lidarium.envs.simulation.endings import REASONS


def test_reasons_are_numbered_and_a_policys_own_come_last():
    numbers = [ending_number(reason) for reason in (None, *REASONS[1:])]
    assert len(set(numbers)) == len(numbers)
    assert ending_number("out of coffee") == len(REASONS)


def test_rows_have_the_names_of_single_infos_with_masks_beside_them():
    rows = {
        "truth": {"pose": np.arange(6.0).reshape(2, 3), "_pose": np.ones(2, bool)},
        "coverage": np.array([0.5, 0.25], np.float32),
        "_coverage": np.ones(2, bool),
        "ended_because": np.array([None, REASONS[1]], object),
    }
    found = flat_row_infos(rows, 2)
    assert found["truth.pose.1"].tolist() == [1.0, 4.0]
    assert found["coverage"].tolist() == [0.5, 0.25]
    assert found["ended"].tolist() == [0.0, 1.0]
    names = {name for name in found if not name.startswith("_")}
    assert names == {"truth.pose.0", "truth.pose.1", "truth.pose.2", "coverage", "ended"}
    assert all(found[f"_{name}"].tolist() == [True, True] for name in names)
    assert flat_row_infos({}, 3)["ended"].tolist() == [0.0, 0.0, 0.0]
