"""The network in numpy."""

import numpy as np
import pytest
from drawn_decisions import drawn_decision

from lidarium.agents.learned.network import Network, check_weights, shapes


def weights(scale=0.1, seed=0):
    generator = np.random.default_rng(seed)
    return {
        name: (scale * generator.normal(size=shape)).astype(np.float32) for name, shape in shapes().items()
    }


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
    assert sum(int(np.prod(shape)) for shape in shapes().values()) <= 300_000


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
        check_weights(arrays, "a file")
