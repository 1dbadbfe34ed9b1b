"""What maps know is counted in step with them."""

import numpy as np
import pytest
from seen_truth import NEAR, begun, scribbled

from lidarium.evaluation.metrics import cells
from lidarium.evaluation.truth.beliefs import free_as_held, maps_on_floor
from lidarium.evaluation.truth.map_tally import MapTally
from lidarium.evaluation.truth.true_map import truth_of


def test_sizes_are_those_of_the_true_masks():
    env = begun()
    truth = truth_of(env)
    assert MapTally(env, truth).sizes.tolist() == [
        truth.knowable.sum(),
        truth.valid.sum(),
        truth.counted.sum(),
    ]


@pytest.mark.parametrize("options", [{}, {"known_starts": False}, {"radio": "range"}])
def test_steps_between_two_counts_are_all_taken_in(options):
    env = begun(**options)
    truth, generator = truth_of(env), np.random.default_rng(3)
    tally = MapTally(env, truth)
    for step in range(30):
        env.step({agent: np.array([1.0, generator.uniform(-1.0, 1.0)], np.float32) for agent in env.agents})
        tally.note_step(env)
        if step % 7 == 6:
            tally.take_in(env)
            maps = maps_on_floor(env)
            held = free_as_held(env, maps) & truth.counted
            found = tally.counts[-1:, 2] if tally.shares else tally.counts[:-1, 2]
            assert set(held.sum(axis=(1, 2)).tolist()) == set(found.tolist())
            assert tally.known_shares == pytest.approx(
                [cells.known_coverage(own != 0, truth.knowable) for own in maps]
            )


def test_what_has_not_been_taken_in_is_not_counted():
    env = begun(NEAR[:1])
    tally = MapTally(env, truth_of(env))
    tally.take_in(env)
    before = tally.counts.copy()
    scribbled(env, np.random.default_rng(0))
    tally.note_step(env)
    assert np.array_equal(tally.counts, before)
    tally.take_in(env)
    assert not np.array_equal(tally.counts, before)
