"""Options of films are checked before anything is written."""

from pathlib import Path

import pytest

from lidarium.scripts.options.film import FilmFiles, FilmOptions


def test_films_are_those_that_are_asked_for():
    assert FilmFiles().films == []
    assert FilmFiles(gif=Path("a.gif"), video=Path("b.mp4")).films == [Path("a.gif"), Path("b.mp4")]


def test_settings_hold_what_the_options_say():
    settings = FilmOptions(film_speed=5.0, film_width=320).film_settings
    assert (settings.speed, settings.width) == (5.0, 320)
    with pytest.raises(ValueError, match="speed"):
        assert FilmOptions(film_speed=0.0).film_settings


def test_bad_names_of_films_leave_nothing(tmp_path):
    FilmFiles(gif=tmp_path / "a.gif").check_films()
    with pytest.raises(ValueError, match=r"a\.txt"):
        FilmFiles(gif=tmp_path / "a.txt").check_films()
    (tmp_path / "folder.mp4").mkdir()
    with pytest.raises(IsADirectoryError, match="it is a folder; want a new name"):
        FilmFiles(video=tmp_path / "folder.mp4").check_films()
    assert [path.name for path in tmp_path.iterdir()] == ["folder.mp4"]
