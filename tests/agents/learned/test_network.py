"""The network in numpy."""

import hashlib
import json
import lzma
import pickle
import re
from importlib import resources
from pathlib import Path

import numpy as np
import pytest
from drawn_decisions import drawn_decision

from lidarium.agents.learned import network
from lidarium.agents.learned.network import (
    CARD,
    FILES,
    SHIPPED,
    Network,
    _shapes,
    load_weights,
    predictor_of,
    save_weights,
)
from lidarium.mapping.files import weight_files


def weights(scale=0.1, seed=0):
    generator = np.random.default_rng(seed)
    return {name: (scale * generator.normal(size=shape)).astype(np.float32) for name, shape in _shapes().items()}


def classic_weights():
    found = weights()
    found["correction.weight"][:], found["correction.bias"][:], found["steepness"][:] = 0.0, 0.0, 1.0
    return found


def test_without_a_correction_classic_tours_decide():
    generator = np.random.default_rng(3)
    network = Network(classic_weights())
    for options, teammates in ((2, 0), (6, 1), (14, 7)):
        decision = drawn_decision(generator, options, teammates)
        np.testing.assert_array_equal(network.preferences(decision), decision.scores)
        assert network(decision) == decision.classic


def test_what_the_mask_forbids_is_never_chosen():
    generator, network = np.random.default_rng(4), Network(weights(0.5))
    for _ in range(20):
        decision = drawn_decision(generator)
        decision.mask[:] = False
        decision.mask[3] = True
        assert network(decision) == 3


def test_preferences_do_not_depend_on_the_order_of_options():
    from dataclasses import replace

    decision, network = drawn_decision(np.random.default_rng(5), 7, 3), Network(weights(0.3))
    order = np.random.default_rng(6).permutation(7)
    turned = replace(
        decision,
        options=decision.options[order],
        crops=decision.crops[order],
        scores=decision.scores[order],
        mask=decision.mask[order],
    )
    expected = network.preferences(decision)[order]
    np.testing.assert_allclose(network.preferences(turned), expected, rtol=1e-4, atol=1e-4)


def test_it_has_at_most_300000_parameters():
    assert sum(int(np.prod(shape)) for shape in _shapes().values()) <= 300_000


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda arrays: arrays.pop("option.bias"), "lacks the array 'option.bias'"),
        (lambda arrays: arrays.update(more=np.zeros(1, np.float32)), "has the array 'more'"),
        (lambda arrays: arrays.update(steepness=np.zeros(2, np.float32)), r"\(2,\); want float32 \(1,\)"),
        (lambda arrays: arrays.update(steepness=np.zeros(1)), "float64"),
        (lambda arrays: arrays["last.bias"].fill(np.nan), "not finite"),
    ],
)
def test_weights_of_another_network_are_refused(change, message):
    arrays = weights()
    change(arrays)
    with pytest.raises(ValueError, match=message):
        FILES.check(arrays, "a file")


def drawn():
    generator = np.random.default_rng(0)
    return {name: generator.normal(size=shape).astype(np.float32) for name, shape in _shapes().items()}


def test_what_was_saved_is_loaded(tmp_path):
    saved = drawn()
    digest = save_weights(tmp_path / "a" / "weights.safetensors", saved)
    path = tmp_path / "a" / "weights.safetensors"
    assert hashlib.sha256(path.read_bytes()).hexdigest() == digest
    found = load_weights(path)
    assert found.keys() == saved.keys()
    for name, array in saved.items():
        np.testing.assert_array_equal(found[name], array)


def test_files_say_on_whose_maps_the_weights_were_trained(tmp_path):
    files = [tmp_path / "plain.safetensors", tmp_path / "predicted.safetensors"]
    save_weights(files[0], drawn())
    save_weights(files[1], drawn(), "network")
    assert [predictor_of(file) for file in files] == ["nothing", "network"]
    assert predictor_of() == "network"
    np.testing.assert_array_equal(load_weights(files[0])["option.bias"], load_weights(files[1])["option.bias"])
    files[1].write_bytes(files[1].read_bytes()[:100])
    with pytest.raises(ValueError, match="no file of weights, or is truncated"):
        predictor_of(files[1])


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
    lacking = drawn()
    lacking.pop("steepness")
    with pytest.raises(ValueError, match="steepness"):
        save_weights(tmp_path / "weights.safetensors", lacking)
    assert not list(tmp_path.iterdir())


def save_packed(path, weights):
    """Save weights as the package has them; return the hash of what is packed."""
    digest = save_weights(path, weights)
    path.write_bytes(lzma.compress(path.read_bytes()))
    return digest


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A package whose weights are in another folder."""
    monkeypatch.setattr(weight_files.resources, "files", lambda name: tmp_path)
    network._shipped.cache_clear()
    digest = save_packed(tmp_path / "data" / SHIPPED, drawn())
    (tmp_path / "data" / CARD).write_text(json.dumps({"sha256": digest}))
    yield tmp_path / "data"
    network._shipped.cache_clear()


def test_weights_of_the_package_are_those_that_their_card_names(package):
    np.testing.assert_array_equal(load_weights()["steepness"], drawn()["steepness"])


def test_weights_of_the_package_that_were_changed_are_refused(package):
    other = drawn()
    other["steepness"][0] += 1.0
    save_packed(package / SHIPPED, other)
    with pytest.raises(ValueError, match=r"not what its card learned\.json names; install"):
        load_weights()


@pytest.mark.parametrize("damage", [None, "", "[]", "{}", "3"])
@pytest.mark.parametrize("name", [SHIPPED, CARD])
def test_a_package_without_weights_or_card_says_what_to_do(package, name, damage):
    path = package / name
    path.unlink() if damage is None else path.write_text(damage)
    with pytest.raises(ValueError, match="install the package again"):
        load_weights()


@pytest.mark.parametrize("path", [3, 2.5, True, ["a"]])
def test_what_is_no_name_of_a_file_is_refused(path):
    with pytest.raises(ValueError, match="want the name of a file"):
        load_weights(path)


def test_no_pickle_is_loaded_from_file_to_policy(tmp_path, monkeypatch):
    """Neither by the policy nor by what a training reads; torch and numpy could."""
    import torch
    from drawn_decisions import drawn_decision

    from lidarium.agents import make_policy
    from lidarium.training.teaching.samples import read_samples, samples_of, write_samples
    from lidarium.training.teaching.teacher import Lesson

    def load(*arguments, **options):
        raise AssertionError("a pickle is loaded")

    path = tmp_path / "weights.safetensors"
    save_weights(path, drawn())
    lesson = Lesson(drawn_decision(np.random.default_rng(0)), np.zeros(5))
    for module, names in ((pickle, ("load", "loads", "Unpickler")), (torch, ("load",))):
        for name in names:
            monkeypatch.setattr(module, name, load)
    assert make_policy("learned", weights=path).choose_option(lesson.decision) in range(5)
    write_samples(tmp_path / "lessons.npz", samples_of([lesson]))
    assert len(read_samples(tmp_path / "lessons.npz")) == 1


def test_no_source_of_training_and_policy_loads_pickles():
    root = Path(network.__file__).resolve().parents[2]
    words = re.compile(r"import pickle|pickle\.load|torch\.(load|save)|allow_pickle=True|joblib|cloudpickle")
    paths = [*(root / "agents").rglob("*.py"), *(root / "training").rglob("*.py")]
    assert len(paths) > 20
    assert not [path for path in paths if words.search(path.read_text(encoding="utf-8"))]


def test_the_package_ships_weights_that_are_what_their_card_names():
    folder = resources.files("lidarium.agents.learned") / "data"
    content = lzma.decompress((folder / SHIPPED).read_bytes())
    card = json.loads((folder / CARD).read_text(encoding="utf-8"))
    assert hashlib.sha256(content).hexdigest() == card["sha256"]
    assert len(content) <= 5_000_000
    assert load_weights().keys() == _shapes().keys()
    assert {"training", "validation", "hours", "versions"} <= card.keys()
