"""A whole training, small."""

import json

import numpy as np
import pytest

from lidarium.agents.learned.weights import load_weights
from lidarium.training.settings import training_of
from lidarium.training.training import Training

SMALL = {
    "seed": 1,
    "settings": {"resolution": 0.05},
    "rounds": [
        {"floors": 2, "kinds": {"apartment": 1.0}, "robots": [1, 2]},
        {"floors": 2, "kinds": {"apartment": 1.0}, "robots": [1]},
    ],
    "fit": {"epochs": 2, "batch": 8},
    "ppo": {"decisions": 48, "checkpoint": 16, "environments": 1, "steps": 16, "batch": 8, "epochs": 1},
    "validation": {"floors": ["apartment:2000000"], "robots": [1]},
}


class KilledError(Exception):
    """Stands for the death of the process."""


def run(folder, settings=SMALL, steps=None):
    """Run a training, or so many steps of it."""
    training = Training(training_of(settings), folder)
    seen = []
    for step in training.run():
        seen.append(step)
        if steps is not None and len(seen) == steps:
            raise KilledError
    return seen


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    folder = tmp_path_factory.mktemp("training")
    run(folder)
    return folder


def test_a_training_leaves_weights_and_a_card(whole):
    card = json.loads((whole / "card.json").read_text())
    assert card["best"] in card["validation"]
    assert set(card["validation"]) == {"round-0", "round-1", "rewards"}
    assert card["validation"][card["best"]]["episodes"] == 1
    assert [number for number, _ in card["rewards"]] == [16, 32, 48]
    assert set(card["fits"]) == {"round-0", "round-1"}
    assert load_weights(whole / "weights.safetensors").keys()
    assert list((whole / "tensorboard").iterdir())


def test_a_training_that_was_killed_goes_on_to_the_same_end(whole, tmp_path):
    steps = 1
    while True:
        try:
            run(tmp_path / "a", steps=steps)
            break
        except KilledError:
            steps += 2
    one, other = (
        load_weights(whole / "weights.safetensors"),
        load_weights(tmp_path / "a" / "weights.safetensors"),
    )
    for name, array in one.items():
        np.testing.assert_array_equal(array, other[name])
    cards = [json.loads((folder / "card.json").read_text()) for folder in (whole, tmp_path / "a")]
    assert cards[0]["rewards"] == cards[1]["rewards"]
    assert cards[0]["fits"] == cards[1]["fits"]


def test_a_finished_training_does_nothing_more(whole):
    before = {path: path.stat().st_mtime_ns for path in whole.rglob("*.safetensors")}
    assert run(whole)[-1].part == "done"
    after = {path: path.stat().st_mtime_ns for path in whole.rglob("*.safetensors")}
    before.pop(whole / "weights.safetensors"), after.pop(whole / "weights.safetensors")
    assert before == after


def test_a_folder_of_another_training_is_refused(whole):
    with pytest.raises(ValueError, match=r"holds a training with seed = 1, this one has 2"):
        run(whole, {**SMALL, "seed": 2})


def test_a_folder_of_other_files_is_refused(tmp_path):
    (tmp_path / "mine.txt").write_text("x")
    with pytest.raises(ValueError, match="no training has written them"):
        run(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]


def test_a_damaged_checkpoint_is_named(whole, tmp_path):
    import shutil

    folder = tmp_path / "b"
    shutil.copytree(whole, folder)
    newest = sorted((folder / "rewards").glob("*.learner.safetensors"))[-1]
    newest.write_bytes(newest.read_bytes()[:100])
    settings = {**SMALL, "ppo": {**SMALL["ppo"], "decisions": 64}}
    (folder / "training.json").unlink()
    for path in folder.iterdir():
        if path.name != "rewards":
            (shutil.rmtree if path.is_dir() else type(path).unlink)(path)
    from lidarium.training.reinforcement.learning import learn

    with pytest.raises(ValueError, match=r"learner\.safetensors is damaged"):
        list(learn(training_of(settings), folder / "rewards", None, 1, tmp_path / "log"))
