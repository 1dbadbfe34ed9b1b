"""How an episode begins."""

import numpy as np
import pytest

from lidarium.envs.engine.beginnings import begin, goal_of_robots, map_frames
from lidarium.envs.floors.floor import Floor
from lidarium.envs.floors.floor_choice import FloorChoice
from lidarium.envs.settings.making import make_settings
from lidarium.envs.settings.reset_options import ResetOptions

HALL = Floor("hall", (0.0, 0.0, 6.0, 4.0), starts=np.array([[1.0, 1.0, 0.0], [4.0, 3.0, 1.0]]), goal=(5.0, 1.0))


def begun(seed=0, floor=HALL, chosen=None, **options):
    settings = make_settings(**{"robots": 2, "resolution": 0.05, **options})
    drawn = begin(np.random.default_rng(seed), FloorChoice(floor), chosen or ResetOptions(), settings)
    return drawn, settings


def test_an_episode_is_drawn_from_its_generator():
    first, again, other = (begun(seed, chosen=ResetOptions(starts="drawn"))[0] for seed in (1, 1, 2))
    assert np.array_equal(first.starts, again.starts)
    assert first.seed == again.seed != other.seed
    assert not np.array_equal(first.starts, other.starts)
    assert np.array_equal(begun()[0].starts, HALL.starts)


def test_map_frames_begin_at_the_corner_of_the_cell_of_the_start():
    beginning, settings = begun(chosen=ResetOptions(starts=np.array([[1.03, 1.07, 0.0], [4.0, 3.0, 1.0]])))
    frames = map_frames(beginning, settings)
    away = beginning.starts[:, :2] - frames
    assert (away >= -1e-9).all()
    assert (away < 0.05 + 1e-9).all()
    cells = (frames - np.array(beginning.tables.laser.origin)) / 0.05
    assert np.allclose(cells, np.round(cells))
    unknown, settings = begun(known_starts=False)
    assert not map_frames(unknown, settings).any()


def test_a_goal_is_known_with_the_start_only():
    assert goal_of_robots(*begun()) == (5.0, 1.0)
    assert goal_of_robots(*begun(chosen=ResetOptions(goal=(2.0, 2.0)))) == (2.0, 2.0)
    assert np.isnan(goal_of_robots(*begun(known_starts=False))).all()


def test_robots_fit_below_the_ceiling():
    low = Floor("low", (0.0, 0.0, 6.0, 4.0), ceiling=0.5)
    with pytest.raises(ValueError, match=r"floor 'low' has its ceiling at 0\.5 m, the robot is 0\.52 m high"):
        begun(floor=low)
