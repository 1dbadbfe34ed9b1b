"""Many episodes: they begin, step and end, each by itself."""

import numpy as np
import pytest
from linked_rooms import TWO_ROOMS

from lidarium.envs.engine.engine import Engine
from lidarium.envs.settings.making import make_settings
from lidarium.envs.settings.reset_options import ResetOptions
from lidarium.envs.simulation.endings import HORIZON, NO_FRONTIER, REASONS

EVERY = np.arange(2)
AHEAD = np.tile([0.5, 0.1], (4, 1))


def batch_of(level="velocity", **options):
    options = {"robots": 2, "stop_coverage": None, "map_cells": 32, **options}
    return Engine(2, TWO_ROOMS, make_settings(**options), level)


def step(batch, actions, beginning=EVERY[:0], **options):
    batch.run(batch.level.read_rows(actions, batch.live), beginning, **options)


def test_episodes_begin_one_by_one_and_step_from_then_on():
    batch = batch_of()
    assert not batch.is_ready
    assert not batch.live.any()
    with pytest.raises(RuntimeError, match="was not reset; call reset"):
        batch.scenes()
    batch.run(None, np.array([1]), [3])
    assert not batch.is_ready
    assert batch.live.tolist() == [False, False, True, True]
    step(batch, AHEAD, np.array([0]), seeds=[4])
    assert batch.is_ready
    assert batch.is_whole
    assert batch.acted.tolist() == [False, False, True, True]
    assert batch.world.steps.tolist() == [0, 1]
    assert batch.rewards[:2].tolist() == [0.0, 0.0]
    assert batch.floors[0].name == batch.floors[1].name == "two_rooms"
    assert len(batch.scenes()) == 2
    step(batch, AHEAD, np.array([1]), seeds=[5])
    assert batch.acted.tolist() == [True, True, False, False]
    assert batch.world.steps.tolist() == [1, 0]


def test_a_batch_that_cannot_begin_runs_nothing():
    batch = batch_of()
    batch.run(None, EVERY, [1, 2])
    outside = ResetOptions(starts=np.array([[1.0, 2.0, 0.0], [50.0, 1.0, 0.0]]))
    with pytest.raises(ValueError, match="start"):
        step(batch, AHEAD, np.array([1]), seeds=[3], options={1: outside})
    assert batch.world.steps.tolist() == [0, 0]
    assert batch.is_whole


def test_the_horizon_cuts_one_episode_and_leaves_the_other():
    batch = batch_of(horizon_s=0.2)
    batch.run(None, np.array([0]), [1])
    step(batch, AHEAD, np.array([1]), seeds=[2])
    assert not batch.has_endings
    step(batch, AHEAD)
    assert batch.reasons.tolist() == [HORIZON, HORIZON, 0, 0]
    assert batch.truncated.tolist() == [True, True, False, False]
    assert not batch.terminated.any()
    assert batch.is_over.tolist() == [True, False]
    assert not batch.is_whole
    before = batch.world.poses.copy()
    step(batch, AHEAD)
    assert np.array_equal(batch.world.poses[:2], before[:2])
    assert batch.rewards[:2].tolist() == [0.0, 0.0]
    assert not batch.acted[:2].any()


def test_terms_add_up_to_rewards():
    batch = batch_of(reward={"time": 0.5})
    batch.run(None, EVERY, [1, 2])
    step(batch, AHEAD)
    terms = batch.infos["reward_terms"]
    assert terms["time"] == pytest.approx(np.full(4, -0.05))
    assert sum(terms.values()) == pytest.approx(batch.rewards)


def test_robots_without_frontiers_end_by_their_own_reason():
    batch = batch_of("frontier")
    batch.run(None, EVERY, [1, 2])
    for grid in batch.simulation.beliefs.log_odds[:2]:
        grid[:] = 100
    batch.simulation.beliefs.windows[:2] = [0, grid.shape[0], 0, grid.shape[1]]
    batch.perception.start(None, 0)
    batch.level.start(0)
    step(batch, np.zeros(4))
    assert batch.reasons.tolist() == [NO_FRONTIER, NO_FRONTIER, 0, 0]
    assert batch.terminated.tolist() == [True, True, False, False]
    assert batch.infos["ended_because"].tolist() == [REASONS[NO_FRONTIER]] * 2 + [None] * 2


def test_there_is_at_least_one_episode():
    for episodes in (0, -1, 2.0, True, "2"):
        with pytest.raises(ValueError, match="the number of episodes is"):
            Engine(episodes, TWO_ROOMS, make_settings())
