"""Where the robots of a trial start."""

import numpy as np
from small_pictures import RESOLUTION, save_room

from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.floors.catalogue.names import load_floor
from lidarium.envs.settings.making import make_settings
from lidarium.evaluation.suites.starts import drawn_starts, starts_for, starts_in

SETTINGS = make_settings(robots=2, resolution=0.05)


def test_starts_are_drawn_by_the_seed_and_fit():
    first, again, other = (drawn_starts("apartment", SETTINGS, seed) for seed in (3, 3, 4))
    assert first == again != other
    env = ExplorationEnv("apartment", SETTINGS)
    env.reset(seed=0, options={"starts": np.array(first)})
    assert env.world.starts.tolist() == first


def test_the_starts_of_the_floor_are_taken_if_the_settings_ask_for_them():
    settings = make_settings(robots=2, resolution=0.05, starts="fixed")
    assert drawn_starts("apartment", settings, 3) is None
    assert starts_for("apartment", settings, 3) == load_floor("apartment").starts[:2].tolist()
    assert starts_for("apartment", SETTINGS, 3) == drawn_starts("apartment", SETTINGS, 3)


def test_on_a_floor_without_starts_of_its_own_the_reset_draws(tmp_path):
    room = save_room(tmp_path)
    assert drawn_starts(room, SETTINGS, 0, RESOLUTION) is None
    env = ExplorationEnv(room, SETTINGS, image_resolution=RESOLUTION)
    env.reset(seed=5)
    assert starts_in(room, SETTINGS, 5, RESOLUTION) == env.world.starts.tolist()
    assert starts_in(room, SETTINGS, 6, RESOLUTION) != env.world.starts.tolist()
