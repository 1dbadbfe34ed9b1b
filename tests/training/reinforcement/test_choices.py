"""Episodes whose decisions are asked for one by one."""

import numpy as np

import lidarium
from lidarium.agents.learned.policy import ChosenTours
from lidarium.evaluation.episodes.runner import run_episode
from lidarium.training.places import Place
from lidarium.training.reinforcement.choices import AskedEpisode
from lidarium.training.settings import TrainingSettings

SETTINGS = {"resolution": 0.1, "stop_coverage": 0.9}


def test_a_policy_and_a_training_see_the_same_to_the_bit():
    """What is decided in a training is what a policy decides in the environment that users make."""
    team = TrainingSettings(settings=SETTINGS).team(2)
    env = lidarium.parallel_env("apartment:7", robots=2, horizon_s=team.horizon_s, **SETTINGS, starts="fixed")
    seen = []

    def choose(decision):
        seen.append(decision)
        return decision.classic

    starts = [list(start) for start in starts_of(team)]
    run_episode(ChosenTours(choose), env, 3, {"starts": starts})
    episode = AskedEpisode(Place("apartment:7", team, 3))
    for decision in seen:
        asked = episode.ask()
        for name in ("options", "crops", "teammates", "situation", "scores", "mask"):
            np.testing.assert_array_equal(getattr(asked.decision, name), getattr(decision, name))
        episode.answer(decision.classic)
    last = episode.ask()
    assert last.decision is None
    assert (last.time_s, last.coverage) == (env.scorer.time, env.scorer.coverage)
    assert len(seen) >= 3


def starts_of(team):
    from lidarium.evaluation.suites.starts import drawn_starts

    return drawn_starts("apartment:7", team, 3)
