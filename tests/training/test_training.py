"""A whole training, small."""

import hashlib
import json
import re
import shutil
from contextlib import closing

import numpy as np
import pytest

from lidarium.agents.learned.network import load_weights
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
    "ppo": {"decisions": 24, "checkpoint": 8, "environments": 1, "steps": 8, "batch": 8, "epochs": 1},
    "validation": {"floors": ["apartment:2000000"], "robots": [1]},
}


class KilledError(Exception):
    """Stands for the death of the process."""


def run(folder, settings=SMALL, steps=None, is_killed=False):
    """Run a training, or so many steps of it."""
    if is_killed:
        with pytest.raises(KilledError):
            run(folder, settings, steps)
        return []
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
    assert set(card["validation"]) == {"round-0", "round-1", "mean", "rewards"}
    assert card["validation"][card["best"]]["episodes"] == 1
    assert [number for number, _ in card["rewards"]] == [8, 16, 24]
    assert set(card["fits"]) == {"round-0", "round-1"}
    assert {"lidarium", "python", "numpy", "torch", "sb3-contrib"} <= card["versions"].keys()
    assert card["training"]["seed"] == 1
    assert card["sha256"] == hashlib.sha256((whole / "weights.safetensors").read_bytes()).hexdigest()
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
    assert run(whole)[-1].part == "best weights"
    after = {path: path.stat().st_mtime_ns for path in whole.rglob("*.safetensors")}
    before.pop(whole / "weights.safetensors"), after.pop(whole / "weights.safetensors")
    assert before == after


def test_a_folder_that_was_moved_goes_on(whole, tmp_path):
    moved = tmp_path / "moved"
    shutil.copytree(whole, moved)
    path = moved / "validation" / "episodes.jsonl"
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join(lines[:-1]))
    assert run(moved)[-1].part == "best weights"
    keys = [json.loads(line)["key"] for line in path.read_text().splitlines()]
    assert sorted(keys) == sorted(json.loads(line)["key"] for line in lines)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"seed": 2}, "seed = 1, this one has 2"),
        ({"fit": {"epochs": 3, "batch": 8}}, "fit.epochs = 2, this one has 3"),
        ({"rounds": SMALL["rounds"][:1]}, "rounds.1.bare_share = 0.0, this one has 'nothing'"),
        ({"settings": {"resolution": 0.1}}, "settings.resolution = 0.05, this one has 0.1"),
    ],
)
def test_a_folder_of_another_training_is_refused(whole, change, words):
    with pytest.raises(ValueError, match=rf"holds a training with {re.escape(words)}; choose another folder"):
        run(whole, {**SMALL, **change})


def test_a_training_that_was_killed_while_it_began_goes_on(tmp_path):
    unfinished = tmp_path / ".training.json.ab_12xyz"
    unfinished.mkdir()
    (unfinished / "training.json").write_text('{"se')
    run(tmp_path, steps=1, is_killed=True)
    assert json.loads((tmp_path / "training.json").read_text())["seed"] == 1
    assert not unfinished.exists()


def test_what_killed_writers_left_is_removed(tmp_path):
    run(tmp_path, steps=1, is_killed=True)
    left = [
        tmp_path / ".weights.safetensors.0123abcd",
        tmp_path / "round-0" / "lessons" / ".000000.npz.0123abcd",
    ]
    others = [tmp_path / ".gitignore", tmp_path / ".notes.txt.0123abcd"]
    for path in left + others:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(b"half")
    run(tmp_path, steps=1, is_killed=True)
    assert not any(path.exists() for path in left)
    assert all(path.exists() for path in others)


def test_a_second_training_in_the_same_folder_is_refused(tmp_path):
    with closing(Training(training_of(SMALL), tmp_path).run()) as first:
        next(first)
        unfinished = tmp_path / ".hours.json.abcd1234"
        unfinished.mkdir()
        with pytest.raises(ValueError, match=r"training\.json is being written to by another process"):
            run(tmp_path, steps=1)
        assert unfinished.exists()
    run(tmp_path, steps=1, is_killed=True)
    assert not unfinished.exists()


def test_a_training_of_another_version_is_refused(whole, tmp_path):
    asked = json.loads((whole / "training.json").read_text())
    (tmp_path / "training.json").write_text(json.dumps({**asked, "version": "0.0.1"}))
    with pytest.raises(ValueError, match=r"version = '0\.0\.1'.*choose another folder"):
        run(tmp_path)


def test_floors_of_the_validation_are_checked_before_anything_is_written(tmp_path):
    settings = {**SMALL, "validation": {"floors": ["castle:3"], "robots": [1]}}
    with pytest.raises((ValueError, FileNotFoundError), match="castle:3"):
        run(tmp_path / "new", settings)
    assert not (tmp_path / "new").exists()


def test_what_only_an_environment_refuses_is_refused_before_anything_is_written(tmp_path):
    for settings, words in (({"reward": {"more": {"nix": 1.0}}}, "'nix'"), ({"scan_period_s": 50.0}, "longer than")):
        with pytest.raises(ValueError, match=words):
            run(tmp_path / "new", {**SMALL, "settings": settings})
        assert not (tmp_path / "new").exists()


def test_a_folder_of_other_files_is_refused(tmp_path):
    (tmp_path / "mine.txt").write_text("x")
    with pytest.raises(ValueError, match="no training has written them"):
        run(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]


def test_the_mean_of_the_last_two_rounds_is_tried(whole):
    first, second = (load_weights(whole / f"round-{number}" / "weights.safetensors") for number in range(2))
    for name, array in load_weights(whole / "mean.safetensors").items():
        np.testing.assert_allclose(array, (first[name] + second[name]) / 2.0, rtol=1e-6, atol=1e-7)
