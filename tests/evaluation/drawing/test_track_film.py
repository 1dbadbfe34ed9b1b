"""Films of records, alone or side by side, without their floors or versions."""

from dataclasses import replace

import pytest
from films_read import read_film, share_of

from lidarium.envs.drawing.frame_parts import EXPLORED, INK, team_colours
from lidarium.evaluation.drawing import track_film
from lidarium.evaluation.drawing.films import FilmSettings
from lidarium.evaluation.drawing.track_film import save_side_by_side, save_track_film


@pytest.fixture
def foreign(apartment_record):
    """A record of a version that is not known, on a floor that is not there."""
    changed = {"version": "0.0.7", "floor": "attic", "floor_source": None, "settings": {}}
    return replace(apartment_record, header={**apartment_record.header, **changed})


@pytest.mark.parametrize(("ending", "rate"), [(".mp4", 20), (".gif", 10), (".webp", 10)])
def test_a_film_runs_at_its_speed(foreign, tmp_path, ending, rate):
    path = tmp_path / f"track{ending}"
    save_track_film(path, foreign, FilmSettings(speed=40.0, width=360))
    film = read_film(path)
    assert film.seconds == pytest.approx(foreign.display.times[-1] / 40.0 + 1.5, abs=1.01 / rate)
    assert film.frames.shape[2] == 360
    assert share_of(film.frames[0], EXPLORED) < share_of(film.frames[-1], EXPLORED)
    assert [each.name for each in tmp_path.iterdir()] == [path.name]


def test_records_run_side_by_side_in_step(foreign, recorded, tmp_path):
    short = recorded(robots=2, horizon_s=4.0, resolution=0.05)[0]
    path = tmp_path / "both.gif"
    save_side_by_side(path, {"one": foreign, "two": short}, "attic", FilmSettings(speed=20.0, width=498))
    film = read_film(path)
    assert film.seconds == pytest.approx(foreign.display.times[-1] / 20.0 + 1.5, abs=0.11)
    assert film.frames.shape[2] == 498
    left, right = film.frames[:, :, :246], film.frames[:, :, 252:]
    # The short one shows its end from then on; the other goes on.
    assert (right[8, 80:] == right[-1, 80:]).all()
    assert share_of(left[8], EXPLORED) < share_of(left[-1], EXPLORED)
    assert share_of(left[-1, 80:], team_colours(3)[2]) > 0.0005
    assert share_of(right[0, 80:], team_colours(3)[2]) == 0.0
    assert share_of(film.frames[0], INK) > 0.03


@pytest.mark.parametrize(("count", "columns", "rows"), [(1, 1, 1), (2, 2, 1), (4, 2, 2), (5, 3, 2), (9, 3, 3)])
def test_tiles_stand_in_rows_and_can_be_read(foreign, count, columns, rows):
    tiles = track_film._Tiles({str(k): foreign for k in range(count)}, "attic", 900, columns)
    frame = tiles.draw(10.0)
    assert track_film._columns(count) == columns
    assert frame.shape[1] <= 900
    assert frame.shape[0] % 2 == frame.shape[1] % 2 == 0
    is_line = (frame[:, 2] == INK).all(axis=1)
    assert (is_line[1:] & ~is_line[:-1]).sum() == rows


@pytest.mark.parametrize("count", [0, 10])
def test_a_film_shows_up_to_nine(foreign, tmp_path, count):
    with pytest.raises(ValueError, match=f"the film shows {count} episodes; want 1 to 9"):
        save_side_by_side(tmp_path / "x.gif", {str(k): foreign for k in range(count)}, "attic")
    assert not list(tmp_path.iterdir())
