"""Weights in files."""

import hashlib
import json
import pickle
from importlib import resources

import numpy as np
import pytest

from lidarium.agents.learned.network import shapes
from lidarium.agents.learned.weights import CARD, SHIPPED, load_weights, save_weights


def drawn():
    generator = np.random.default_rng(0)
    return {name: generator.normal(size=shape).astype(np.float32) for name, shape in shapes().items()}


def test_what_was_saved_is_loaded(tmp_path):
    weights = drawn()
    digest = save_weights(tmp_path / "a" / "weights.safetensors", weights)
    path = tmp_path / "a" / "weights.safetensors"
    assert hashlib.sha256(path.read_bytes()).hexdigest() == digest
    found = load_weights(path)
    assert found.keys() == weights.keys()
    for name, array in weights.items():
        np.testing.assert_array_equal(found[name], array)


@pytest.mark.parametrize("length", [0, 5, 100, 5000])
def test_truncated_files_are_refused(tmp_path, length):
    path = tmp_path / "weights.safetensors"
    save_weights(path, drawn())
    path.write_bytes(path.read_bytes()[:length])
    with pytest.raises(ValueError, match="no file of weights, or is truncated"):
        load_weights(path)


def test_pickles_are_not_loaded(tmp_path):
    path = tmp_path / "weights.pt"
    path.write_bytes(pickle.dumps({"steepness": 1.0}))
    with pytest.raises(ValueError, match="no file of weights"):
        load_weights(path)


def test_large_files_are_refused(tmp_path):
    path = tmp_path / "weights.safetensors"
    path.write_bytes(bytes(6_000_000))
    with pytest.raises(ValueError, match=r"5,?000,?000|large|bytes"):
        load_weights(path)


def test_weights_of_another_network_are_not_written(tmp_path):
    weights = drawn()
    weights.pop("steepness")
    with pytest.raises(ValueError, match="steepness"):
        save_weights(tmp_path / "weights.safetensors", weights)
    assert not list(tmp_path.iterdir())


def test_the_package_ships_weights_that_are_what_their_card_names():
    folder = resources.files("lidarium.agents.learned") / "data"
    content = (folder / SHIPPED).read_bytes()
    card = json.loads((folder / CARD).read_text(encoding="utf-8"))
    assert hashlib.sha256(content).hexdigest() == card["sha256"]
    assert len(content) <= 5_000_000
    assert load_weights().keys() == shapes().keys()
    assert {"training", "validation", "hours", "versions"} <= card.keys()
