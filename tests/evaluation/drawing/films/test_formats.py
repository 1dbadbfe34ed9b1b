"""The ending of a name says what a film is; settings check themselves."""

from pathlib import Path

import pytest

from lidarium.evaluation.drawing.films.formats import FORMATS, FilmSettings, format_of


@pytest.mark.parametrize("name", ["a.mp4", "a.gif", "a.webp", "A.GIF", "b.mp4.gif"])
def test_an_ending_is_a_format(name):
    assert format_of(Path(name)) is FORMATS[name[name.rindex(".") :].lower()]


@pytest.mark.parametrize("name", ["a.avi", "a", "gif", "a.gif.txt", ".gif"])
def test_other_endings_are_refused_with_those_that_are_known(name):
    with pytest.raises(ValueError, match=r"want one of \.mp4, \.gif, \.webp"):
        format_of(Path(name))


@pytest.mark.parametrize("speed", [0.0, -1.0, float("nan"), float("inf")])
def test_a_film_runs_forward(speed):
    with pytest.raises(ValueError, match="speed of the film is"):
        FilmSettings(speed)


@pytest.mark.parametrize("width", [0, 119, 4097])
def test_a_film_has_a_width(width):
    with pytest.raises(ValueError, match=f"width of the film is {width} pixels"):
        FilmSettings(width=width)


@pytest.mark.parametrize("rate", [0.0, 51.0, float("nan")])
def test_a_film_has_frames(rate):
    with pytest.raises(ValueError, match="frames per second"):
        FilmSettings(frames_per_second=rate)


def test_what_is_left_out_is_as_the_format_has_it():
    assert FilmSettings().width_of(Path("a.mp4")) == 980
    assert FilmSettings().rate_of(Path("a.gif")) == 10.0
    assert FilmSettings(width=300, frames_per_second=5).width_of(Path("a.gif")) == 300
    assert FilmSettings(width=300, frames_per_second=5).rate_of(Path("a.mp4")) == 5
