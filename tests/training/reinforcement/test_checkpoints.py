"""Checkpoints of a training by rewards."""

import numpy as np
import pytest
import torch
from drawn_decisions import drawn_decision
from safetensors.numpy import load_file, save_file
from torch import nn

from lidarium.agents.learned.network import WIDTH
from lidarium.mapping.files.weight_files import WeightFiles
from lidarium.training.decisions import stacked
from lidarium.training.reinforcement.checkpoints import (
    Checkpoint,
    Learner,
    latest_checkpoint,
    restore,
    weights_of,
    write_checkpoint,
)
from lidarium.training.torch_network import ExplorerNetwork, Seen


def learner(seed, steps=0):
    """Return a network and what learns, after some updates."""
    torch.manual_seed(seed)
    network, critic = ExplorerNetwork(), nn.Linear(WIDTH, 1)
    found = Learner(critic, torch.optim.Adam([*network.parameters(), *critic.parameters()], lr=1e-2))
    for _ in range(steps):
        update(network, found)
    return network, found


def update(network, found):
    decisions = stacked([drawn_decision(np.random.default_rng(k)) for k in range(3)])
    preferences, situation = network(Seen(decisions))
    found.optimizer.zero_grad()
    (preferences.softmax(dim=1)[:, 0].sum() + found.critic(situation.detach()).square().sum()).backward()
    found.optimizer.step()


def written(folder, decisions=8, steps=2):
    folder.mkdir(exist_ok=True)
    network, found = learner(0, steps)
    checkpoint = Checkpoint(decisions, [(4, None), (decisions, 0.25)])
    write_checkpoint(folder, checkpoint, network, found)
    return checkpoint, network, found


def test_network_critic_and_optimizer_go_on_as_if_nothing_had_happened(tmp_path):
    checkpoint, network, found = written(tmp_path)
    assert latest_checkpoint(tmp_path) == checkpoint
    other, restored = learner(1)
    restore(tmp_path, checkpoint, other, restored)
    for _ in range(2):
        update(network, found)
        update(other, restored)
    for name, array in network.weights().items():
        np.testing.assert_array_equal(other.weights()[name], array)
    for one, two in zip(found.critic.parameters(), restored.critic.parameters(), strict=True):
        assert torch.equal(one, two)


def test_the_last_two_stay(tmp_path):
    network, found = learner(0, 1)
    for number in range(1, 5):
        write_checkpoint(tmp_path, Checkpoint(8 * number, [(8 * number, None)]), network, found)
    kept = {path.name.partition(".")[0] for path in tmp_path.iterdir()}
    assert kept == {"decisions-000000024", "decisions-000000032"}
    assert len(list(tmp_path.iterdir())) == 6
    assert weights_of(tmp_path, latest_checkpoint(tmp_path)).is_file()


@pytest.mark.parametrize("kept", [0, 1, 2])
def test_of_a_kill_between_two_files_the_checkpoint_before_is_left(tmp_path, monkeypatch, kept):
    """The first files of the next checkpoint are there, that which makes it one is not."""
    before, _, _ = written(tmp_path)
    counted = []

    def die(*arguments, **options):
        raise KeyboardInterrupt

    def counting(write):
        def dying(*arguments, **options):
            counted.append(arguments)
            return (die if len(counted) > kept else write)(*arguments, **options)

        return dying

    from lidarium.training.reinforcement import checkpoints

    for where, name in ((WeightFiles, "save"), (checkpoints, "write_whole"), (checkpoints, "write_json")):
        monkeypatch.setattr(where, name, counting(getattr(where, name)))
    network, found = learner(0, 3)
    with pytest.raises(KeyboardInterrupt):
        write_checkpoint(tmp_path, Checkpoint(16, []), network, found)
    assert latest_checkpoint(tmp_path) == before
    restore(tmp_path, before, *learner(1))


def test_of_a_kill_while_old_ones_are_removed_the_last_two_are_whole(tmp_path, monkeypatch):
    network, found = learner(0, 1)
    for number in (1, 2):
        write_checkpoint(tmp_path, Checkpoint(8 * number, [(8 * number, None)]), network, found)

    def die(path, **options):
        path.unlink_really()
        raise KeyboardInterrupt

    kind = type(tmp_path)
    monkeypatch.setattr(kind, "unlink_really", kind.unlink, raising=False)
    monkeypatch.setattr(kind, "unlink", die)
    with pytest.raises(KeyboardInterrupt):
        write_checkpoint(tmp_path, Checkpoint(24, []), network, found)
    monkeypatch.undo()
    assert sorted(path.stem for path in tmp_path.glob("*.json")) == [
        "decisions-000000016",
        "decisions-000000024",
    ]
    for number in (16, 24):
        restore(tmp_path, Checkpoint(number, []), *learner(1))
    write_checkpoint(tmp_path, Checkpoint(32, []), network, found)
    assert len(list(tmp_path.iterdir())) == 6


def refused(folder, checkpoint, words):
    """Assert that a checkpoint is refused by name, and that network and learner stay as they were."""
    network, found = learner(1)
    before = network.weights()
    with pytest.raises(ValueError, match=words) as raised:
        restore(folder, checkpoint, network, found)
    assert "remove" in str(raised.value)
    assert len(str(raised.value)) <= 500
    for name, array in before.items():
        np.testing.assert_array_equal(network.weights()[name], array)
    assert not found.optimizer.state


@pytest.mark.parametrize("end", [".safetensors", ".learner.safetensors"])
@pytest.mark.parametrize("length", [0, 100, 5000, None])
def test_damaged_truncated_and_missing_files_are_named(tmp_path, end, length):
    checkpoint, _, _ = written(tmp_path)
    path = tmp_path / f"decisions-000000008{end}"
    if length is None:
        path.unlink()
    else:
        path.write_bytes(path.read_bytes()[:length])
    refused(tmp_path, checkpoint, rf"decisions-000000008\{end} is missing, damaged or of another network")


@pytest.mark.parametrize(
    "change",
    [
        lambda arrays: arrays.pop("0.exp_avg"),
        lambda arrays: arrays.pop("3.step"),
        lambda arrays: arrays.pop("critic.bias"),
        lambda arrays: arrays.update({"0.exp_avg": np.zeros(3, np.float32)}),
        lambda arrays: arrays.update({"critic.weight": np.zeros((2, 2), np.float32)}),
    ],
)
def test_a_learner_of_another_network_is_refused(tmp_path, change):
    checkpoint, _, _ = written(tmp_path)
    path = tmp_path / "decisions-000000008.learner.safetensors"
    arrays = load_file(path)
    change(arrays)
    save_file(arrays, path)
    refused(tmp_path, checkpoint, r"learner\.safetensors is missing, damaged or of another network")


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        "{}",
        '{"decisions": "x", "curve": []}',
        '{"decisions": 8, "curve": []}',
        '{"decisions": 8, "curve": [[4, 0.5]]}',
        '{"decisions": 8, "curve": [[4, NaN], [8, 0.5]]}',
        '{"decisions": 8, "curve": [[4, 0.5], [8, Infinity]]}',
        "{" * 1000,
    ],
)
def test_a_damaged_state_is_named(tmp_path, text):
    written(tmp_path)
    (tmp_path / "decisions-000000008.json").write_text(text)
    with pytest.raises(ValueError, match=r"decisions-000000008\.json is not .*; remove .*000000008\.\* to go"):
        latest_checkpoint(tmp_path)


def test_an_empty_folder_has_no_checkpoint(tmp_path):
    assert latest_checkpoint(tmp_path) is None
    assert latest_checkpoint(tmp_path / "nowhere") is None
