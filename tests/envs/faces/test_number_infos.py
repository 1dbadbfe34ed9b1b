"""Infos as numbers under the same names."""

import gymnasium
import numpy as np
import pytest

import lidarium  # noqa: F401 registers the ids
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


def test_numbers_are_tensors_by_gymnasiums_wrapper():
    torch = pytest.importorskip("torch")
    pytest.importorskip("array_api_compat", reason='it is not installed: pip install "gymnasium[array-api]"')
    env = gymnasium.wrappers.NumpyToTorch(gymnasium.make("lidarium/Exploration-v1", infos="flat"))
    _, infos = env.reset(seed=0)
    assert 0.0 < infos["truth.coverage"].item() < 1.0
    observation, _, _, _, infos = env.step(torch.zeros(2))
    assert infos
    assert all(isinstance(value, torch.Tensor) for value in (*observation.values(), *infos.values()))
