"""Files of records: small, whole or not at all, and refused where they are not good."""

import json
import zipfile
from dataclasses import replace

import numpy as np
import pytest

import lidarium
from lidarium.evaluation.drawing.record_frames import TrackFrames, radius_of
from lidarium.evaluation.record import read_record, write_record


@pytest.fixture
def path(apartment_record, tmp_path):
    write_record(tmp_path / "episode.npz", apartment_record)
    return tmp_path / "episode.npz"


def rewritten(path, **changes):
    """Change members of a record: bytes, or None to leave one out."""
    with zipfile.ZipFile(path) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in {**members, **changes}.items():
            if content is not None:
                archive.writestr(name, content)
    return path


def with_header(path, **changes):
    with zipfile.ZipFile(path) as archive:
        header = json.loads(archive.read("header.json"))
    header = {name: value for name, value in {**header, **changes}.items() if value is not ...}
    return rewritten(path, **{"header.json": json.dumps(header).encode()})


def assert_equal(one, other):
    assert one.header == other.header
    np.testing.assert_array_equal(one.commands, other.commands)
    for name in ("times", "poses", "coverage"):
        np.testing.assert_array_equal(getattr(one.display, name), getattr(other.display, name))
    for name in ("rows", "words", "times", "counts", "places", "known", "occupied"):
        np.testing.assert_array_equal(getattr(one.display.changes, name), getattr(other.display.changes, name))
    assert (one.display.origin, one.display.resolution) == (other.display.origin, other.display.resolution)
    assert one.display.events == other.display.events


def test_a_record_is_read_as_it_was_written(apartment_record, path):
    assert_equal(read_record(path), apartment_record)


def test_the_same_record_gives_the_same_file(apartment_record, path, tmp_path):
    write_record(tmp_path / "again.npz", read_record(path))
    assert (tmp_path / "again.npz").read_bytes() == path.read_bytes()


def test_numpy_opens_it_without_pickles(apartment_record, path):
    with np.load(path, allow_pickle=False) as arrays:
        np.testing.assert_array_equal(arrays["commands"], apartment_record.commands)


def test_ten_minutes_with_three_robots_take_less_than_a_megabyte(recorded, tmp_path):
    """The first 100 seconds, the most eventful ones, with noise and fine maps: in less than a sixth of a
    megabyte."""
    record, _ = recorded(
        floor="building:23", robots=3, resolution=0.025, noise="thesis", horizon_s=100.0, stop_coverage=None
    )
    write_record(tmp_path / "episode.npz", record)
    assert record.header["steps"] == 1000
    assert (tmp_path / "episode.npz").stat().st_size < 1_000_000 / 6


@pytest.mark.parametrize("share", [0.0, 0.1, 0.5, 0.9, 0.999])
def test_a_file_that_was_cut_short_is_refused_by_name(path, share):
    content = path.read_bytes()
    path.write_bytes(content[: int(share * len(content))])
    with pytest.raises(ValueError, match=r"episode\.npz is not a whole episode record"):
        read_record(path)


def test_a_file_with_a_damaged_byte_anywhere_is_refused_or_reads_the_same(apartment_record, path):
    content = path.read_bytes()
    refused = 0
    for place in range(7, len(content), len(content) // 100):
        path.write_bytes(content[:place] + bytes([content[place] ^ 0x55]) + content[place + 1 :])
        try:
            record = read_record(path)
        except ValueError:
            refused += 1
        else:
            assert_equal(record, apartment_record)
    assert refused > 90


def test_what_is_no_record_is_refused(tmp_path):
    (tmp_path / "notes.txt").write_text("nothing of the kind")
    np.savez(tmp_path / "other.npz", map=np.zeros(3))
    for name in ("notes.txt", "other.npz"):
        with pytest.raises(ValueError, match=f"{name} is not a whole episode record"):
            read_record(tmp_path / name)
    with pytest.raises(FileNotFoundError, match=r"none\.npz"):
        read_record(tmp_path / "none.npz")


def test_a_newer_format_is_refused_naming_both(path):
    with pytest.raises(
        ValueError,
        match=rf"format 2, written by lidarium 9\.1.*this is lidarium {lidarium.__version__}.*up to 1",
    ):
        read_record(with_header(path, format=2, version="9.1", starts=...))


def test_a_record_of_another_version_can_be_shown(apartment_record, path):
    record = read_record(with_header(path, version="0.0.7", settings={}, what_comes_later=1))
    np.testing.assert_array_equal(record.display.map_at(30.0), apartment_record.display.map_at(30.0))
    assert radius_of(record) > 0.0
    assert TrackFrames(record, size=64).draw(1.0).shape[2] == 3


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"format": ...}, "number of its format"),
        ({"format": "one"}, "number of its format"),
        ({"starts": ...}, "no key starts"),
        ({"robots": 0}, "robots 0; want a whole number"),
        ({"robots": 2}, "3 starts for 2 robots"),
        ({"time_step": -0.1}, "time_step -0.1; want a number above 0"),
        ({"noise_seed": 1.5}, "noise_seed 1.5"),
        ({"goal": [1.0]}, "goal"),
        ({"endings": [[1, 2, 3]]}, "endings"),
        ({"steps": 5}, "commands has shape"),
        ({"map_shape": [2, 2]}, "do not fit a map of 2 x 2 words"),
        ({"final_sha256": "short"}, "64 hexadecimal digits"),
        ({"settings": {"robot": 5}}, "settings with a robot that cannot be used: want an object instead of 5"),
        ({"settings": {"robot": {"radius": 10**400}}}, "settings with a robot that cannot be used"),
        ({"settings": {"robot": {"radius": -1.0}}}, "settings with a robot that cannot be used"),
        ({"settings": {"robot": {"a": 1}}}, "unknown setting 'a'"),
        ({"settings": {"camera": {"columns": "many"}}}, "settings with a camera that cannot be used"),
    ],
)
def test_a_header_that_is_not_good_is_refused(path, changes, words):
    with pytest.raises(ValueError, match=rf"episode\.npz is not a whole.*{words}"):
        read_record(with_header(path, **changes))


def test_members_that_are_not_good_are_refused(path):
    for member, content in (
        ("poses.npy", None),
        ("poses.npy", b"no array"),
        ("events.json", b"{}"),
        ("events.json", b'[{"time_s": 0.0, "kind": "decision", "agent": "robot_0", "x": 1.0}]'),
        ("header.json", b"["),
    ):
        original = path.read_bytes()
        with pytest.raises(ValueError, match=r"episode\.npz is not a whole episode record"):
            read_record(rewritten(path, **{member: content}))
        path.write_bytes(original)


def test_an_event_that_json_cannot_hold_is_refused_and_nothing_is_written(apartment_record, tmp_path):
    display = replace(
        apartment_record.display,
        events=[{"time_s": 0.0, "kind": "message", "agent": None, "what": np.zeros(2)}],
    )
    with pytest.raises(ValueError, match="JSON"):
        write_record(tmp_path / "below" / "episode.npz", replace(apartment_record, display=display))
    assert not list(tmp_path.iterdir())


def test_a_file_is_there_whole_or_not_at_all(apartment_record, tmp_path, monkeypatch):
    (tmp_path / "episode.npz").write_bytes(b"the one before")

    def fail(self, content):
        with open(self, "wb") as file:
            file.write(content[:100])
        raise OSError(28, "No space left on device", str(self))

    monkeypatch.setattr("pathlib.Path.write_bytes", fail)
    with pytest.raises(OSError, match="No space left"):
        write_record(tmp_path / "episode.npz", apartment_record)
    assert [file.name for file in tmp_path.iterdir()] == ["episode.npz"]
    assert (tmp_path / "episode.npz").read_bytes() == b"the one before"
