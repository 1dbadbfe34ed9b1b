"""Networks fitted to lessons."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from drawn_decisions import drawn_decision

from lidarium.agents.learned.features import OPTION_FEATURES, TEAMMATE_FEATURES
from lidarium.training.decisions import MOST_OPTIONS, stacked
from lidarium.training.settings import FitSettings
from lidarium.training.teaching.fitting import evaluate, fit, held_out_of, mirrored
from lidarium.training.teaching.samples import Samples
from lidarium.training.torch_network import ExplorerNetwork

GAIN = list(OPTION_FEATURES).index("gain")


def floor_of(seed, count=40):
    """Return samples of two options, that of less gain costs 8 m more, whatever tours say."""
    generator = np.random.default_rng(seed)
    decisions = stacked([drawn_decision(generator, 2, 1) for _ in range(count)])
    worse = decisions.options[:, :2, GAIN].argmin(axis=1)
    regrets = np.zeros((count, MOST_OPTIONS), np.float32)
    regrets[np.arange(count), worse] = 8.0
    return Samples(decisions, regrets)


def test_what_costs_less_is_learned_and_holds_on_other_floors():
    torch.manual_seed(0)
    network, settings = ExplorerNetwork(), FitSettings(epochs=25, batch=64, learning_rate=2e-3)
    unseen = floor_of(1000, 400)
    assert evaluate(network, [unseen], settings) == pytest.approx(4.0, abs=0.6)
    course = list(fit(network, [floor_of(seed) for seed in range(20)], settings, 0))
    assert len(course) == 25
    assert evaluate(network, [unseen], settings) < 1.0


def test_the_best_epoch_on_what_is_held_out_is_kept():
    torch.manual_seed(0)
    network, settings = ExplorerNetwork(), FitSettings(epochs=6, batch=16, learning_rate=1e-3, held_out=0.5)
    floors = [floor_of(seed, 20) for seed in range(4)]
    course = list(fit(network, floors, settings, 3))
    held = [evaluate(network, [floors[k]], settings) for k in np.flatnonzero(held_out_of(4, 0.5))]
    best = min(each.held_out for each in course)
    assert np.mean(held) == pytest.approx(best, abs=1e-6)


@pytest.mark.parametrize("share", [0.0, 0.1, 0.5, 1.0])
def test_floors_that_are_held_out_stay_so_when_more_follow(share):
    whole = held_out_of(1000, share)
    assert 0 < whole.sum() < 1000
    assert abs(whole.mean() - share) < 0.03
    for count in (2, 3, 10, 500):
        part = held_out_of(count, share)
        assert 0 < part.sum() < count
        # But for one that is added, and one that is left out, where there are few.
        assert (part != whole[:count]).sum() <= 2
    if share == 0.1:
        np.testing.assert_array_equal(held_out_of(500, share), whole[:500])


def test_great_regrets_are_all_alike():
    network, samples = ExplorerNetwork(), floor_of(0)
    samples.regrets[samples.regrets > 0.0] = 1e6
    found = evaluate(network, [samples], FitSettings(most_regret=5.0))
    assert found == pytest.approx(evaluate(network, [floor_of(0)], FitSettings(most_regret=5.0)))


def test_the_same_seed_gives_the_same_weights():
    found = []
    for _ in range(2):
        torch.manual_seed(5)
        network = ExplorerNetwork()
        list(fit(network, [floor_of(0), floor_of(1)], FitSettings(epochs=2, batch=32), 1))
        found.append(network.weights())
    for name, array in found[0].items():
        np.testing.assert_array_equal(array, found[1][name])


def test_mirrored_twice_is_as_before():
    decisions = floor_of(0, 5).decisions
    once = mirrored(decisions)
    left = list(OPTION_FEATURES).index("left")
    np.testing.assert_array_equal(once.options[..., left], -decisions.options[..., left])
    sine = list(TEAMMATE_FEATURES).index("sine")
    np.testing.assert_array_equal(once.teammates[..., sine], -decisions.teammates[..., sine])
    np.testing.assert_array_equal(once.crops[0, 0, :, 0], decisions.crops[0, 0, :, -1])
    for name in ("options", "crops", "teammates"):
        np.testing.assert_array_equal(getattr(mirrored(once), name), getattr(decisions, name))


def test_one_floor_is_too_few():
    with pytest.raises(ValueError, match="2 at least"):
        list(fit(ExplorerNetwork(), [replace(floor_of(0))], FitSettings(), 0))
