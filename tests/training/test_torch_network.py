"""The network in PyTorch beside that in numpy."""

import numpy as np
import pytest
import torch
from drawn_decisions import drawn_decision

from lidarium.agents.learned.network import FILES, Network
from lidarium.training.decisions import stacked
from lidarium.training.torch_network import ExplorerNetwork, Seen


def network(scale, seed=0):
    torch.manual_seed(seed)
    made = ExplorerNetwork()
    with torch.no_grad():
        for parameter in made.parameters():
            parameter += scale * torch.randn_like(parameter)
    return made


@pytest.mark.parametrize("scale", [0.0, 0.05])
def test_numpy_and_pytorch_agree(scale):
    generator = np.random.default_rng(0)
    shapes = [(2, 0), (14, 8), (5, 1), (9, 3)]
    decisions = [drawn_decision(generator, *shape) for shape in shapes]
    made = network(scale)
    FILES.check(made.weights(), "the network")
    with torch.no_grad():
        found = made(Seen(stacked(decisions)))[0].numpy()
    plain = Network(made.weights())
    for row, decision in zip(found, decisions, strict=True):
        expected = plain.preferences(decision)
        allowed = np.flatnonzero(decision.mask)
        np.testing.assert_allclose(row[allowed], expected[allowed], rtol=1e-5, atol=1e-5)
        assert (row[len(decision.mask) :] < -1e8).all()


def test_a_new_network_prefers_as_classic_tours_do():
    decisions = [drawn_decision(np.random.default_rng(k)) for k in range(4)]
    with torch.no_grad():
        preferences = network(0.0)(Seen(stacked(decisions)))[0]
    assert preferences.argmax(dim=1).tolist() == [decision.classic for decision in decisions]


def test_weights_taken_over_are_those_of_the_other_network():
    first, second = network(0.1, 1), network(0.1, 2)
    second.set_weights(first.weights())
    for name, array in first.weights().items():
        np.testing.assert_array_equal(second.weights()[name], array)


def test_what_is_not_there_changes_nothing():
    decision = drawn_decision(np.random.default_rng(7), 4, 2)
    table = stacked([decision])
    other = stacked([decision])
    other.options[:, 4:], other.crops[:, 4:], other.teammates[:, 2:] = 3.0, 1, -3.0
    made = network(0.1)
    with torch.no_grad():
        np.testing.assert_allclose(made(Seen(table))[0].numpy(), made(Seen(other))[0].numpy(), atol=1e-5)
