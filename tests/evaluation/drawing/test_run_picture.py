import cv2
import imageio.v2 as imageio
import numpy as np
import pytest

import lidarium
from lidarium.envs.exploration import ExplorationEnv
from lidarium.envs.floors.catalogue.names import load_floor
from lidarium.envs.settings.making import make_settings
from lidarium.evaluation.drawing.run_picture import frontiers_left, save_floor_picture, save_run_picture
from lidarium.evaluation.drawing.video import film
from lidarium.evaluation.episodes.runner import run_episode
from lidarium.evaluation.episodes.watching import WatchedExploration


def explored(policy="nearest_frontier", kind=ExplorationEnv, on_decision=None, **options):
    env = kind("apartment", make_settings(**{"robots": 2, "resolution": 0.05, "horizon_s": 10.0, **options}))
    return run_episode(lidarium.policy(policy), env, 0, on_decision=on_decision)


@pytest.mark.parametrize(
    "options", [{}, {"known_starts": False}, {"robots": 18, "horizon_s": 1.0}, {"resolution": 0.1}]
)
def test_a_run_has_a_picture(tmp_path, options):
    save_run_picture(tmp_path / "run.png", explored(**options), "nearest_frontier")
    picture = cv2.imread(str(tmp_path / "run.png"))
    assert min(picture.shape[:2]) > 600
    assert len(np.unique(picture.reshape(-1, 3), axis=0)) > 100
    assert [path.name for path in tmp_path.iterdir()] == ["run.png"]


def test_frontiers_left_are_on_the_floor_in_either_frame():
    for known_starts in (True, False):
        episode = explored(horizon_s=2.0, known_starts=known_starts)
        left, given_up = frontiers_left(episode)
        x_min, y_min, x_max, y_max = episode.env.floor.bounds
        assert len(left) > 0
        assert given_up.shape[1] == 2
        assert (left >= (x_min, y_min)).all()
        assert (left <= (x_max, y_max)).all()


def test_a_floor_has_a_picture(tmp_path):
    save_floor_picture(tmp_path / "floor.png", load_floor("apartment"), 0.3)
    assert cv2.imread(str(tmp_path / "floor.png")).shape[1] > 600


def test_a_film_has_frames_at_equal_simulated_time(tmp_path):
    path = tmp_path / "run.mp4"
    with film(path, speed=20.0, size=160) as camera:

        def begin(env):
            if not env.watchers:
                camera.begin(env)
                env.watchers.append(camera)

        episode = explored(kind=WatchedExploration, on_decision=begin, horizon_s=6.0)
        assert not path.exists()
        camera.end(episode.env)
    with imageio.get_reader(path) as reader:
        # A frame at 0, 1, ... 6 s, and the last one held for 1.5 s at 20 frames a second.
        assert reader.count_frames() == 7 + 30
        assert reader.get_data(3).ndim == 3
    assert [entry.name for entry in tmp_path.iterdir()] == ["run.mp4"]


def test_a_film_runs_forward(tmp_path):
    with pytest.raises(ValueError, match="speed of the film is 0"), film(tmp_path / "x.mp4", speed=0.0):
        pass
    assert not list(tmp_path.iterdir())
