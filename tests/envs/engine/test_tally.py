"""What an episode has come to."""

import numpy as np
from scored_halls import scored

from lidarium.envs.engine.tally import THRESHOLDS
from lidarium.envs.settings.rewards import RewardSettings


def test_rewards_are_area_less_prices_and_sum_over_the_steps():
    weights = RewardSettings(area=2.0, time=0.5, contact=3.0, energy=0.25)
    simulation, scorer = scored(weights)
    simulation.score.earned.fill(0.0)
    expected = np.zeros(2)
    for _ in range(30):
        before = simulation.world.travelled.copy()
        simulation.step(np.array([[0.5, 0.0], [0.6, 0.0]]))
        scorer.advance()
        expected += (
            2.0 * 0.05**2 * simulation.score.gains
            - 0.5 * 0.1
            - 3.0 * simulation.world.contacts
            - 0.25 * (simulation.world.travelled - before)
        )
    assert simulation.world.contacts.any()
    assert np.allclose(simulation.score.rewards, expected)
    assert np.allclose(simulation.score.reward_terms.sum(axis=1), expected)


def test_thresholds_are_timed_once_and_in_order():
    simulation, scorer = scored(RewardSettings(), 1)
    for _ in range(400):
        simulation.step(np.array([[0.3, 0.8]]))
        scorer.advance()
    times = list(scorer.times.values())
    assert list(scorer.times) == list(THRESHOLDS[: len(times)])
    assert times == sorted(times)
    assert len(times) >= 2
    curve_times, coverages = zip(*scorer.curve, strict=True)
    assert list(coverages) == sorted(coverages)
    assert curve_times[0] == 0.0
    for threshold, time in scorer.times.items():
        assert min(t for t, c in scorer.curve if c >= threshold) == time
    gaps = np.diff([time for time, _ in scorer.track])
    assert np.allclose(gaps, 0.2)
