"""A film of a user's own, registered in one file, is a choice of `lidarium run`."""

import sys

import numpy as np
import pytest
from films_read import read_film

from lidarium.evaluation.drawing.films import film, frames_of
from lidarium.registry import registry
from lidarium.scripts.main import main

MODULE = """
import numpy as np

from lidarium.evaluation.drawing.films import film


@film("brightness", "A frame that is brighter the more is explored.")
def brightness(env, width):
    return np.full((61, width - 1, 3), int(255 * env.scorer.coverage), np.uint8)


@film("moments", "A class that holds a moment.")
class Moments:
    def __init__(self, policy, width):
        self.policy, self.width = policy, width

    def happens(self, env):
        return env.scorer.time == 1.0

    def draw(self, env):
        return np.zeros((60, self.width, 3), np.uint8)

    @staticmethod
    def check(settings):
        if settings.robots > 1:
            raise ValueError("moments shows one robot; want --robots 1")
"""


@pytest.fixture
def my_films(tmp_path, monkeypatch):
    (tmp_path / "my_films.py").write_text(MODULE)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("LIDARIUM_IMPORT", "")
    path = list(sys.path)
    yield tmp_path
    sys.path[:] = path
    sys.modules.pop("my_films", None)
    for name in {"brightness", "moments"} & set(registry("film")):
        registry("film").unregister(name)


def run(shown, *options):
    arguments = ["--policy", "nearest_frontier", "--map-resolution", "0.05", "--horizon-s", "3", "--gif"]
    films = ["--film-shows", shown, "--film-width", "120", "--film-speed", "1"]
    return main(["run", "--import", "my_films", "--out", "out", *arguments, *films, *options])


def test_a_function_draws_the_frames_of_a_film(my_films):
    assert run("brightness", "--robots", "2") == 0
    found = read_film(my_films / "out" / "run.gif")
    # Sides are made even.
    assert found.frames.shape[1:3] == (62, 120)
    assert found.frames[-1].mean() > found.frames[0].mean()


def test_a_class_may_hold_moments_and_check_the_team(my_films, capsys):
    assert run("moments", "--robots", "1") == 0
    # 3 s, the moment for 1.8 s instead of 0.1 s, and the last frame for 1.5 s.
    assert read_film(my_films / "out" / "run.gif").seconds > 4.5 + 1.5
    assert run("moments", "--robots", "2") == 2
    assert "want --robots 1" in capsys.readouterr().err


def test_films_are_listed_and_unknown_ones_refused(my_films, capsys):
    assert main(["show", "films", "--import", "my_films"]) == 0
    assert "A frame that is brighter" in capsys.readouterr().out
    assert run("brightnes") == 2
    assert "did you mean 'brightness'?" in capsys.readouterr().err


def test_a_frame_of_the_wrong_type_is_refused(my_films, capsys):
    film("grey", "no colours")(lambda env, width: np.zeros((60, width), np.uint8))
    try:
        assert frames_of("grey", None, 120).draw(None).shape == (60, 120)
        assert run("grey", "--robots", "1") == 2
    finally:
        registry("film").unregister("grey")
    assert "want uint8 (rows, columns, 3)" in capsys.readouterr().err
