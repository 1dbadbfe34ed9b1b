"""`lidarium run --record` and `lidarium replay`."""

import contextlib
import json
import shutil
import zipfile
from pathlib import Path

import numpy as np
import pytest
from page_reader import replay_of_page

import lidarium
from lidarium.mapping.files.map_files import write_ros_map
from lidarium.scripts.main import main


@pytest.fixture(scope="module")
def run_folder(tmp_path_factory):
    """A floor, and the record of a run on it."""
    folder = tmp_path_factory.mktemp("recorded")
    levels = np.zeros((30, 50), np.uint8)
    levels[1:29, 1:49] = 255
    levels[10:20, 24] = 0
    write_ros_map(folder / "in", "hall", levels, (0.0, 0.0, 0.0), 0.1)
    with contextlib.chdir(folder):
        options = ["--robots", "2", "--horizon-s", "8", "--stop-coverage", "1", "--record", "--out", "run"]
        assert main(["run", "--floor", "in/hall.yaml", "--policy", "nearest_frontier", *options]) == 0
    return folder


@pytest.fixture
def record(run_folder, tmp_path, monkeypatch):
    """The record of a run on a floor that was named ``in/hall.yaml``, in a folder of the test's own."""
    shutil.copytree(run_folder, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path / "run" / "episode.npz"


def with_header(path, **changes):
    with zipfile.ZipFile(path) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    members["header.json"] = json.dumps({**json.loads(members["header.json"]), **changes}).encode()
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in members.items():
            archive.writestr(name, content)


def test_a_record_is_run_again_and_told_to_be_the_same(record, capsys):
    assert main(["replay", str(record)]) == 0
    told = capsys.readouterr().out
    assert "the same as recorded, to the bit" in told
    assert "hall: nearest_frontier, seed 0" in told


def test_the_figures_are_those_of_the_run(record, tmp_path, capsys):
    assert main(["replay", str(record), "--json", "--out", str(tmp_path / "out")]) == 0
    told = capsys.readouterr().out
    assert told == (tmp_path / "out" / "replay.json").read_text()
    again, result = json.loads(told), json.loads((record.parent / "result.json").read_text())
    assert again["same"]
    names = set(again) & set(result)
    assert {
        "coverage_final",
        "time_s",
        "t85_s",
        "path_m",
        "overlap",
        "collisions",
        "ended_because",
        "iou_occupied",
    } <= names
    assert {name: again[name] for name in names} == {name: result[name] for name in names}


def test_a_run_writes_its_record_beside_its_result(record):
    assert {path.name for path in record.parent.iterdir()} == {
        "episode.npz",
        "map.pgm",
        "map.yaml",
        "result.json",
        "robot_0.pgm",
        "robot_0.yaml",
        "robot_1.pgm",
        "robot_1.yaml",
        "run.png",
        "transforms.json",
    }


def test_a_run_that_comes_out_differently_answers_no(record, capsys):
    with_header(record, final_sha256="0" * 64)
    assert main(["replay", str(record)]) == 3
    assert "not as recorded" in capsys.readouterr().out


def test_a_moved_floor_can_be_named(record, capsys):
    moved = Path("in/hall.yaml").rename("in/moved.yaml")
    assert main(["replay", str(record)]) == 2
    assert "name the floor that was recorded" in capsys.readouterr().err
    assert main(["replay", str(record), "--floor", str(moved)]) == 0


def test_a_record_of_another_version_is_drawn_but_not_run(record, tmp_path, capsys):
    with_header(record, version="0.0.7")
    shutil.rmtree("in")
    assert main(["replay", str(record)]) == 2
    assert "0.0.7" in capsys.readouterr().err
    picture, video = tmp_path / "out" / "track.png", tmp_path / "out" / "track.mp4"
    assert main(["replay", str(record), "--picture", str(picture), "--video", str(video), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["files"] == [str(picture), str(video)]
    assert picture.stat().st_size > 10_000
    assert video.stat().st_size > 1_000


def test_a_run_can_be_recorded_and_filmed(record, tmp_path):
    out = tmp_path / "out"
    assert (
        main(
            [
                "run",
                "--floor",
                "in/hall.yaml",
                "--robots",
                "1",
                "--horizon-s",
                "2",
                "--video",
                "--record",
                "--out",
                str(out),
            ]
        )
        == 0
    )
    assert {"episode.npz", "run.mp4"} <= {path.name for path in out.iterdir()}
    assert main(["replay", str(out / "episode.npz")]) == 0


@pytest.mark.parametrize("option", ["--video-speed 0", "--video-speed nan"])
def test_a_speed_that_is_no_good_is_refused(record, option, tmp_path, capsys):
    assert main(["replay", str(record), "--video", str(tmp_path / "out" / "x.mp4"), *option.split()]) == 2
    assert "speed of the film" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_what_is_no_record_is_refused(tmp_path, capsys):
    (tmp_path / "notes.npz").write_text("nothing of the kind")
    assert main(["replay", str(tmp_path / "notes.npz")]) == 2
    assert "notes.npz is not a whole episode record" in capsys.readouterr().err
    assert main(["replay", str(tmp_path / "none.npz")]) == 2
    assert "none.npz" in capsys.readouterr().err
    assert main(["replay", str(tmp_path)]) == 2


def test_a_place_that_cannot_be_written_to_is_refused_before_the_work(record, tmp_path, capsys):
    (tmp_path / "file").write_text("mine")
    for option in ("--out", "--picture", "--video"):
        place = tmp_path / "file" / "below"
        assert main(["replay", str(record), option, str(place if option == "--out" else place / "x.png")]) == 2
        assert "cannot write to" in capsys.readouterr().err


def test_a_record_is_not_overwritten_and_files_have_the_names_of_their_kind(record, tmp_path, capsys):
    before = record.read_bytes()
    assert main(["replay", str(record), "--demonstrations", str(record)]) == 2
    assert "episode.npz is read, and would be overwritten; choose another name" in capsys.readouterr().err
    with pytest.raises(ValueError, match=r"episode\.npz is read, and would be overwritten; choose another name"):
        lidarium.replay(record, html=record)
    for option in ("--film-speed", "--prediction"):
        assert main(["replay", str(record), option, *(["2"] if option == "--film-speed" else [])]) == 2
        assert f"{option} is given, but n" in capsys.readouterr().err
    for option, suffix in (("picture", ".png"), ("html", ".html"), ("mcap", ".mcap"), ("demonstrations", ".npz")):
        assert main(["replay", str(record), f"--{option}", str(tmp_path / "x.txt")]) == 2
        assert f"x.txt does not fit as a name; want one that ends in {suffix}" in capsys.readouterr().err
    assert record.read_bytes() == before


def test_a_page_is_written_with_the_episode_in_it(record, tmp_path, capsys):
    page = tmp_path / "pages" / "episode.html"
    assert main(["replay", str(record), "--html", str(page)]) == 0
    assert str(page) in capsys.readouterr().out
    header, streams = replay_of_page(page)
    assert (header["floor"], header["policy"], header["robots"]) == ("hall", "nearest_frontier", 2)
    assert header["lacks"] == ""
    assert streams["scans"]


def test_predictions_are_shown_if_they_are_asked_for(record, tmp_path):
    headers, pictures = [], []
    for name, more in (("plain", []), ("predicted", ["--prediction"])):
        files = [str(tmp_path / f"{name}.{ending}") for ending in ("html", "png")]
        assert main(["replay", str(record), "--html", files[0], "--picture", files[1], *more]) == 0
        headers.append(replay_of_page(tmp_path / f"{name}.html")[0])
        pictures.append((tmp_path / f"{name}.png").read_bytes())
    assert headers[0]["prediction"] is None
    assert headers[1]["prediction"]["steps"] > 1
    assert pictures[0] != pictures[1]


def test_a_page_of_a_record_whose_floor_is_gone_says_what_it_lacks(record, tmp_path, capsys):
    shutil.rmtree(tmp_path / "in")
    assert main(["replay", str(record), "--html", "episode.html"]) == 0
    assert "the page is without scans, true walls and the robots' own maps" in capsys.readouterr().err
    header, _ = replay_of_page(tmp_path / "episode.html")
    assert "is not found" in header["lacks"]


def test_a_page_that_cannot_be_written_is_told_before_the_record_is_run(record, tmp_path, capsys):
    (tmp_path / "file").write_text("")
    assert main(["replay", str(record), "--html", str(tmp_path / "file" / "episode.html")]) == 2
    assert "is not a folder" in capsys.readouterr().err
