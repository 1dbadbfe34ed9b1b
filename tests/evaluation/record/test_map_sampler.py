"""The team's map is sampled as changes."""

import numpy as np
import pytest

from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.settings.making import make_settings
from lidarium.evaluation.record.map_sampler import MapSampler
from lidarium.evaluation.truth.beliefs import team_log_odds
from lidarium.mapping.grids.occupancy import three_levels


@pytest.mark.parametrize("known_starts", [True, False])
def test_each_sample_is_the_map_of_its_time(known_starts):
    settings = make_settings(robots=2, resolution=0.05, known_starts=known_starts, noise="datasheet")
    env = ExplorationEnv("apartment", settings)
    env.reset(seed=1)
    generator = np.random.default_rng(2)
    sampler, wanted = MapSampler(env, 2.0), {}
    for step in range(60):
        if step % 20 == 0:
            sampler.sample()
            wanted[env.scorer.time] = three_levels(team_log_odds(env)[0])
            turns = generator.uniform(-1.0, 1.0, 2)
        env.step(
            {agent: np.array([1.0, turn], np.float32) for agent, turn in zip(env.agents, turns, strict=True)}
        )
    changes = sampler.changes()
    assert changes.times.tolist() == pytest.approx(list(wanted))
    for time, levels in wanted.items():
        assert np.array_equal(changes.levels_at(time), levels)
    assert (levels != wanted[0.0]).any()


def test_a_step_has_one_sample_and_a_map_that_rests_has_no_changes():
    env = ExplorationEnv("apartment", make_settings(robots=1, resolution=0.05))
    env.reset(seed=0)
    sampler = MapSampler(env, 2.0)
    sampler.sample()
    first = sampler.changes()
    assert first.times.tolist() == [0.0]
    assert first.counts[0] == len(first.places) > 0
    ascending = first.places[: first.counts[0]]
    assert (np.diff(ascending) > 0).all()
