import cv2
import numpy as np
import pytest

import lidarium
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.floors.catalogue.names import load_floor
from lidarium.envs.settings.making import make_settings
from lidarium.evaluation.drawing.run_picture import frontiers_left, save_floor_picture, save_run_picture
from lidarium.evaluation.episodes.runner import run_episode


def explored(policy="nearest_frontier", **options):
    env = ExplorationEnv("apartment", make_settings(**{"robots": 2, "resolution": 0.05, "horizon_s": 1.0, **options}))
    return run_episode(lidarium.policy(policy), env, 0)


@pytest.mark.parametrize("options", [{"known_starts": False, "resolution": 0.1}, {"robots": 18}])
def test_a_run_has_a_picture(tmp_path, options):
    save_run_picture(tmp_path / "run.png", explored(**options), "nearest_frontier")
    picture = cv2.imread(str(tmp_path / "run.png"))
    assert min(picture.shape[:2]) > 600
    assert len(np.unique(picture.reshape(-1, 3), axis=0)) > 100
    assert [path.name for path in tmp_path.iterdir()] == ["run.png"]


def test_frontiers_left_are_on_the_floor_in_either_frame():
    for known_starts in (True, False):
        episode = explored(horizon_s=1.0, known_starts=known_starts)
        left, given_up = frontiers_left(episode)
        x_min, y_min, x_max, y_max = episode.env.floor.bounds
        assert len(left) > 0
        assert given_up.shape[1] == 2
        assert (left >= (x_min, y_min)).all()
        assert (left <= (x_max, y_max)).all()


def test_a_floor_has_a_picture(tmp_path):
    save_floor_picture(tmp_path / "floor.png", load_floor("apartment"), 0.3)
    assert cv2.imread(str(tmp_path / "floor.png")).shape[1] > 600
