"""A teacher that knows the floor."""

import numpy as np
import pytest

from lidarium.agents.learned.decision import choose_classic
from lidarium.agents.tours.policy import TourFrontier
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.evaluation.episodes.runner import run_episode
from lidarium.training.settings import TrainingSettings
from lidarium.training.teaching.teacher import TaughtTours

FLOORS = ("apartment:7", "apartment:12", "apartment:31", "apartment:44")


def run(make, floor, robots=1):
    env = ExplorationEnv(floor, TrainingSettings(settings={"resolution": 0.05}).team(robots))
    policy = make(env)
    run_episode(policy, env, 0)
    return policy, env.scorer.time


def taught(share):
    return lambda env: TaughtTours(env, choose_classic, share, seed=3)


@pytest.fixture(scope="module")
def lessons():
    return [lesson for floor in FLOORS[:2] for lesson in run(taught(0.0), floor, 2)[0].lessons]


def test_lessons_say_what_each_option_costs_more(lessons):
    assert len(lessons) > 10
    for lesson in lessons:
        mask = lesson.decision.mask
        assert lesson.regrets.shape == mask.shape
        assert lesson.regrets[mask].min() == 0.0
        assert (lesson.regrets >= 0.0).all()
        assert np.isfinite(lesson.regrets).all()


def test_a_teacher_that_only_watches_changes_nothing():
    assert run(taught(0.0), FLOORS[0])[1] == run(lambda env: TourFrontier(), FLOORS[0])[1]


def test_who_knows_the_floor_needs_less_time():
    ratios = [run(taught(1.0), floor)[1] / run(lambda env: TourFrontier(), floor)[1] for floor in FLOORS]
    assert np.exp(np.mean(np.log(ratios))) < 0.95


def test_the_same_seed_gives_the_same_lessons():
    first, second = run(taught(0.5), FLOORS[1])[0].lessons, run(taught(0.5), FLOORS[1])[0].lessons
    assert len(first) == len(second)
    for one, other in zip(first, second, strict=True):
        np.testing.assert_array_equal(one.regrets, other.regrets)
