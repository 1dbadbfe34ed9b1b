"""Frames become a film as they are made, whole or not at all."""

import os
import subprocess
import sys
import weakref

import numpy as np
import pytest
from films_read import read_film, share_of

from lidarium.evaluation.drawing.films import writing
from lidarium.evaluation.drawing.films.formats import FilmSettings
from lidarium.evaluation.drawing.films.writing import film_writer

ENDINGS = [".mp4", ".gif", ".webp"]
BLUE, ORANGE, WHITE = (37, 99, 235), (234, 88, 12), (255, 255, 255)


def frame_of(number, rows=90, columns=160):
    """A blue square that moves over white, and an orange one that stays."""
    frame = np.full((rows, columns, 3), 255, np.uint8)
    frame[10:30, 5 * number : 5 * number + 20] = BLUE
    frame[50:80, 100:140] = ORANGE
    return frame


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_film_has_the_frames_that_were_given(tmp_path, ending):
    path = tmp_path / f"film{ending}"
    with film_writer(path, FilmSettings(frames_per_second=10)) as writer:
        for number in range(8):
            writer.append_data(frame_of(number))
        assert not path.exists()
    film = read_film(path)
    assert film.frames.shape == (8, 90, 160, 3)
    assert film.seconds == pytest.approx(writer.seconds) == pytest.approx(0.8)
    for number in (0, 4, 7):
        assert np.abs(film.frames[number, 15:25, 5 * number + 5 : 5 * number + 15] - BLUE).max() <= 12
        assert share_of(film.frames[number], ORANGE) == pytest.approx(30 * 40 / (90 * 160), abs=0.01)
    assert [entry.name for entry in tmp_path.iterdir()] == [path.name]


@pytest.mark.parametrize("ending", [".gif", ".webp"])
def test_few_colours_come_back_as_they_were(tmp_path, ending):
    path = tmp_path / f"film{ending}"
    with film_writer(path) as writer:
        for number in range(3):
            writer.append_data(frame_of(number))
    assert {tuple(colour) for colour in read_film(path).frames[2].reshape(-1, 3)} == {BLUE, ORANGE, WHITE}


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_frame_can_be_held(tmp_path, ending):
    path = tmp_path / f"film{ending}"
    with film_writer(path) as writer:
        writer.append_data(frame_of(0))
        writer.hold(frame_of(1), 2.0)
    assert read_film(path).seconds == pytest.approx(writer.seconds) == pytest.approx(2.0 + 1 / writer.rate)


def test_what_does_not_change_takes_no_room(tmp_path):
    for name, seconds in (("short.gif", 1.0), ("long.gif", 60.0)):
        with film_writer(tmp_path / name) as writer:
            writer.hold(frame_of(0), seconds)
    short, long = ((tmp_path / name).stat().st_size for name in ("short.gif", "long.gif"))
    assert (long - short) / 590 < 60


@pytest.mark.parametrize("ending", ENDINGS)
def test_no_frame_is_kept(tmp_path, ending):
    given = []
    with film_writer(tmp_path / f"film{ending}") as writer:
        for number in range(60):
            frame = frame_of(number % 20)
            given.append(weakref.ref(frame))
            writer.append_data(frame)
            del frame
            assert sum(each() is not None for each in given) <= 1
    assert not any(each() is not None for each in given[:-1])


@pytest.mark.parametrize("ending", ENDINGS)
def test_wide_frames_are_made_narrower(tmp_path, ending):
    path = tmp_path / f"film{ending}"
    with film_writer(path, FilmSettings(width=241)) as writer:
        writer.append_data(frame_of(1, 300, 480))
        writer.append_data(frame_of(2, 300, 480))
    assert read_film(path).frames.shape[1:] == (150, 240, 3)


@pytest.mark.parametrize("ending", ENDINGS)
@pytest.mark.parametrize("error", [KeyboardInterrupt, ValueError])
def test_a_film_that_is_broken_off_is_not_there(tmp_path, ending, error):
    def break_off():
        with film_writer(tmp_path / f"film{ending}") as writer:
            writer.append_data(frame_of(0))
            raise error

    with pytest.raises(error):
        break_off()
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_film_without_frames_is_an_error(tmp_path, ending):
    with pytest.raises(OSError, match="not whole"), film_writer(tmp_path / f"film{ending}"):
        pass
    assert not list(tmp_path.iterdir())


def test_a_film_of_which_the_second_pass_fails_is_not_there(tmp_path, monkeypatch):
    monkeypatch.setattr(writing, "_is_done", lambda *arguments: False)
    with pytest.raises(OSError, match="not whole"), film_writer(tmp_path / "film.gif") as writer:
        writer.append_data(frame_of(0))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("ending", ENDINGS)
def test_an_encoder_that_ends_early_is_an_error_without_its_command_line(tmp_path, monkeypatch, ending):
    def ends_early(*arguments, **options):
        yield
        raise OSError("FFMPEG COMMAND: ffmpeg -y")

    monkeypatch.setattr(writing.imageio_ffmpeg, "write_frames", ends_early)
    with pytest.raises(OSError, match="not whole") as told, film_writer(tmp_path / f"f{ending}") as writer:
        writer.append_data(frame_of(0))
    assert "COMMAND" not in str(told.value)
    assert f"f{ending}" in str(told.value)
    assert not list(tmp_path.iterdir())


NOISE = """
import sys
from pathlib import Path
import numpy as np
from lidarium.evaluation.drawing.films.writing import film_writer
draws = np.random.default_rng(0)
try:
    with film_writer(Path(sys.argv[1])) as writer:
        for _ in range(40):
            writer.append_data(draws.integers(0, 256, (90, 160, 3), np.uint8))
except OSError as error:
    print(error)
"""


def limit_files():
    import resource

    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))


@pytest.mark.skipif(os.name == "nt", reason="no such limits there")
@pytest.mark.parametrize("ending", ENDINGS)
def test_a_film_that_does_not_fit_is_an_error_and_is_not_there(tmp_path, ending):
    command = [sys.executable, "-c", NOISE, str(tmp_path / f"film{ending}")]
    done = subprocess.run(command, capture_output=True, text=True, preexec_fn=limit_files, timeout=120)
    assert "the film is not whole" in done.stdout, done.stderr
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["a:b [1].gif", "it's 100 %d.mp4", "-x, y;z.webp"])
def test_names_may_have_any_letters(tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    with film_writer(name) as writer:
        writer.append_data(frame_of(0))
        writer.append_data(frame_of(1))
    assert len(read_film(tmp_path / name).frames) == 2


def test_an_older_film_stays_where_a_new_one_fails(tmp_path):
    (tmp_path / "film.gif").write_text("older")
    with pytest.raises(OSError, match="not whole"), film_writer(tmp_path / "film.gif"):
        pass
    assert (tmp_path / "film.gif").read_text() == "older"
