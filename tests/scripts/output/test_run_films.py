"""What films of a run show, where nothing is said."""

import pytest

import lidarium
from lidarium.envs.settings.making import make_settings
from lidarium.evaluation.drawing.films.film import ScanFrames
from lidarium.evaluation.drawing.films.formats import FilmSettings
from lidarium.evaluation.drawing.films.map_frames import MapFrames
from lidarium.evaluation.episodes.watching import WatchedExploration
from lidarium.scripts.output.run_films import RunFilms


@pytest.mark.parametrize(
    ("shown", "options", "kind"),
    [
        ("auto", {"known_starts": True}, ScanFrames),
        ("auto", {"known_starts": False}, MapFrames),
        ("auto", {"known_starts": False, "robots": 1}, ScanFrames),
        ("auto", {"known_starts": False, "camera": "xtion"}, ScanFrames),
        ("maps", {"known_starts": False, "camera": "xtion"}, MapFrames),
        ("maps", {"known_starts": False, "robots": 1}, MapFrames),
        ("scans", {"known_starts": False}, ScanFrames),
    ],
)
def test_maps_are_shown_where_there_are_several(shown, options, kind):
    env = WatchedExploration("open_apartment", make_settings(**{"robots": 2, **options}))
    films = RunFilms(env, lidarium.policy("nearest_frontier"), ["run.gif"], shown, FilmSettings())
    assert isinstance(films._frames(640), kind)


def test_a_run_without_films_writes_nothing(tmp_path):
    env = WatchedExploration("apartment", make_settings(robots=2))
    films = RunFilms(env, lidarium.policy("nearest_frontier"), [], "maps", FilmSettings())
    with films.kept():
        films.begin(tmp_path)
        films.end()
    assert films.seconds == 0.0
    assert not env.watchers
    assert not list(tmp_path.iterdir())
