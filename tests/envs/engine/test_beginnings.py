"""Episodes of a batch begin by draws of their own."""

import numpy as np
import pytest

from lidarium.envs.engine.beginnings import Beginnings
from lidarium.envs.floors.floor import Floor
from lidarium.envs.floors.floor_choice import FloorChoice
from lidarium.envs.settings.making import make_settings
from lidarium.envs.settings.reset_options import ResetOptions

HALL = Floor("hall", (0.0, 0.0, 6.0, 4.0))
SETTINGS = make_settings(robots=2, resolution=0.05)


def beginnings(curriculum=None):
    return Beginnings(FloorChoice(HALL), SETTINGS, 3, curriculum)


def starts_of(drawn):
    return {episode: one.starts.tolist() for episode, one in drawn.items()}


def test_an_episode_begins_by_its_own_seed_whatever_begins_beside_it():
    together = beginnings().draw(np.arange(3), [5, 6, 7], {})
    alone = beginnings().draw(np.array([1]), [6], {})
    assert starts_of(alone)[1] == starts_of(together)[1]
    assert alone[1].seed == together[1].seed != together[0].seed


def test_without_a_seed_the_generator_of_the_episode_goes_on():
    one, other = beginnings(), beginnings()
    first = one.draw(np.array([0]), [5], {})
    other.draw(np.arange(3), [5, 8, 9], {})
    later, same = one.draw(np.array([0]), None, {}), other.draw(np.array([0]), None, {})
    assert starts_of(later) == starts_of(same) != starts_of(first)


def test_what_cannot_begin_leaves_the_generators_as_they_were():
    tried, plain = beginnings(), beginnings()
    for made in (tried, plain):
        made.draw(np.arange(2), [1, 2], {})
    with pytest.raises(ValueError, match="start"):
        tried.draw(np.arange(2), None, {1: ResetOptions(starts=np.array([[-9.0, 0.0, 0.0], [1.0, 1.0, 0.0]]))})
    assert starts_of(tried.draw(np.arange(2), None, {})) == starts_of(plain.draw(np.arange(2), None, {}))


def test_a_curriculum_counts_all_episodes_as_they_begin():
    asked = []
    made = beginnings(lambda number: asked.append(number) or {"starts": "drawn"})
    made.draw(np.array([0, 2]), None, {})
    made.draw(np.array([1]), None, {})
    assert asked == [0, 1, 2]
