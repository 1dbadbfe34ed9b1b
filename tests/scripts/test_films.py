"""`lidarium run`, `replay` and `report` make films that can be shared."""

import json
import shutil

import pytest
from films_read import read_film, share_of

from lidarium.envs.drawing.frame_parts import EXPLORED, team_colours
from lidarium.evaluation.drawing.map_film import JOINED
from lidarium.evaluation.record.file import read_record
from lidarium.scripts.main import main
from lidarium.scripts.run_output import RunFilms

SHORT = ["--robots", "2", "--policy", "nearest_frontier", "--map-resolution", "0.05", "--horizon-s", "4"]


@pytest.fixture(scope="module")
def evaluated(tmp_path_factory):
    """Two policies, one seed, with records."""
    out = tmp_path_factory.mktemp("evaluated")
    options = ["--robots", "2", "--seeds", "1", "--horizon-s", "8", "--map-resolution", "0.05"]
    policies = ["--policies", "nearest_frontier", "random_walk"]
    assert main(["evaluate", *policies, *options, "--workers", "1", "--out", str(out)]) == 0
    return out


@pytest.fixture
def folder(evaluated, tmp_path):
    return shutil.copytree(evaluated, tmp_path / "episodes")


def test_a_run_is_filmed_twice_in_one_pass(tmp_path, capsys):
    options = ["--gif", "--video", "--film-speed", "2", "--film-width", "300", "--film-fps", "8"]
    assert main(["run", *SHORT, *options, "--out", str(tmp_path)]) == 0
    assert "run.mp4, run.gif" in capsys.readouterr().out
    for name in ("run.gif", "run.mp4"):
        film = read_film(tmp_path / name)
        # Frames every 0.25 s of 4 s, and the last one for 1.5 s.
        assert len(film.frames) == 17 + 12
        assert film.seconds == pytest.approx(29 / 8, abs=0.1)
        assert film.frames.shape[2] == 300
        assert share_of(film.frames[0], EXPLORED) < share_of(film.frames[-1], EXPLORED)
        assert all(share_of(film.frames[5], colour) > 1e-4 for colour in team_colours(2))
    assert not [path for path in tmp_path.iterdir() if path.name.startswith(".")]


def test_a_filmed_run_is_the_same_to_the_bit(tmp_path):
    for name, options in (("plain", []), ("filmed", ["--gif"])):
        assert main(["run", *SHORT, "--record", *options, "--out", str(tmp_path / name)]) == 0
    plain, filmed = (read_record(tmp_path / name / "episode.npz") for name in ("plain", "filmed"))
    assert plain.header["final_sha256"] == filmed.header["final_sha256"]


def test_a_team_with_unknown_starts_is_filmed_with_its_maps(tmp_path):
    unknown = [*SHORT[:-1], "2", "--unknown-starts", "--gif"]
    assert main(["run", *unknown, "--out", str(tmp_path / "maps")]) == 0
    assert main(["run", *unknown, "--film-shows", "scans", "--out", str(tmp_path / "scans")]) == 0
    maps, scans = (read_film(tmp_path / name / "run.gif").frames[0] for name in ("maps", "scans"))
    assert maps.shape[1] == scans.shape[1] == 640
    assert maps.shape[0] > scans.shape[0] + 150
    # The lines above the own maps.
    assert all(share_of(maps, colour) > 0.01 for colour in team_colours(2))
    assert share_of(maps, JOINED) == 0.0


def test_maps_are_not_shown_of_a_team_that_shares_one(tmp_path, capsys):
    assert main(["run", *SHORT, "--gif", "--film-shows", "maps", "--out", str(tmp_path / "out")]) == 2
    assert "want scans, or --unknown-starts" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("option", "message"),
    [
        ("--film-speed 0", "speed of the film is 0.0"),
        ("--video-speed -1", "speed of the film is -1.0"),
        ("--film-width 20", "width of the film is 20 pixels; want 120 to 4096"),
        ("--film-fps 99", "99.0 frames per second"),
    ],
)
@pytest.mark.parametrize("command", ["run", "replay", "report"])
def test_options_out_of_range_are_refused_before_the_work(folder, tmp_path, capsys, command, option, message):
    record = next((folder / "records").iterdir())
    film, out = tmp_path / "films" / "film.gif", tmp_path / "out"
    arguments = {
        "run": ["run", *SHORT, "--gif", "--out", str(out)],
        "replay": ["replay", str(record), "--gif", str(film)],
        "report": ["report", str(folder), "--gif", str(film), "--out", str(out)],
    }[command]
    assert main([*arguments, *option.split()]) == 2
    assert message in capsys.readouterr().err
    assert not film.parent.exists()
    assert not out.exists()


def test_a_run_that_is_broken_off_leaves_no_half_film(tmp_path, monkeypatch):
    def interrupted(films):
        raise KeyboardInterrupt

    monkeypatch.setattr(RunFilms, "end", interrupted)
    assert main(["run", *SHORT, "--gif", "--video", "--out", str(tmp_path / "out")]) == 130
    assert not list((tmp_path / "out").iterdir())


def test_a_record_is_filmed(folder, tmp_path, capsys):
    record = next((folder / "records").iterdir())
    films = [tmp_path / "films" / name for name in ("film.gif", "film.mp4")]
    options = ["--gif", str(films[0]), "--video", str(films[1]), "--film-speed", "4", "--film-fps", "10"]
    assert main(["replay", str(record), *options, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["files"] == list(map(str, films))
    for path in films:
        assert read_film(path).seconds == pytest.approx(8.0 / 4.0 + 1.5, abs=0.11)


def test_the_episodes_of_a_folder_are_filmed_side_by_side(folder, tmp_path, capsys):
    film, alone = tmp_path / "films" / "both.gif", tmp_path / "films" / "one.webp"
    assert main(["report", str(folder), "--replays", "0", "--gif", str(film)]) == 0
    assert f"film: {film}" in capsys.readouterr().out
    found = read_film(film)
    assert found.frames.shape[2] == 2 * 360 + 6
    assert found.seconds == pytest.approx(8.0 / 10.0 + 1.5, abs=0.11)
    left, right = found.frames[-1, 80:, :360], found.frames[-1, 80:, 366:]
    assert (left != right).any()
    assert all(share_of(half, colour) > 1e-4 for half in (left, right) for colour in team_colours(2))
    one = ["--film-policies", "random_walk", "--film-width", "200", "--gif", str(alone)]
    assert main(["report", str(folder), "--replays", "0", *one]) == 0
    assert read_film(alone).frames.shape[2] == 200


def test_a_report_without_records_has_no_film_and_writes_nothing(folder, tmp_path, capsys):
    shutil.rmtree(folder / "records")
    film = tmp_path / "films" / "film.gif"
    assert main(["report", str(folder), "--gif", str(film)]) == 2
    assert "want a folder that `lidarium evaluate` wrote without --no-records" in capsys.readouterr().err
    assert not film.parent.exists()
    assert not (folder / "report").exists()


@pytest.mark.parametrize("command", ["replay", "report"])
@pytest.mark.parametrize("option", ["--gif", "--video"])
def test_names_of_no_film_and_places_that_cannot_be_written_are_refused(folder, tmp_path, capsys, command, option):
    what = folder if command == "report" else next((folder / "records").iterdir())
    (tmp_path / "file").write_text("mine")
    (tmp_path / "folder.gif").mkdir()
    for place, message in (
        (tmp_path / "films" / "film.avi", "film.avi has no ending of a film; want one of .mp4, .gif, .webp"),
        (tmp_path / "file" / "film.gif", "cannot write to"),
        (tmp_path / "folder.gif", "it is a folder"),
    ):
        assert main([command, str(what), option, str(place)]) == 2
        assert message in capsys.readouterr().err
    assert not (tmp_path / "films").exists()
    assert not (folder / "report").exists()
