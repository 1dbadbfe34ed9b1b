"""Finished parts of a study in one file."""

import json
import zipfile

import pytest

from lidarium.benchmarks.studies.shared.archive import pack_parts, unpack_parts


def write(folder, name, content):
    (folder / name).parent.mkdir(parents=True, exist_ok=True)
    (folder / name).write_bytes(content)


def lines(*keys):
    return "".join(json.dumps({"key": key}) + "\n" for key in keys).encode()


def test_parts_come_back_and_what_they_do_not_need_stays_out(tmp_path):
    folder, path = tmp_path / "runs", tmp_path / "new" / "parts.zip"
    kept = {
        "runs.jsonl": lines("a", "b"),
        "lessons/team-1/weights.safetensors": b"\x00\xff",
        "lessons/team-1/curve.csv": b"step,coverage\n",
        "suite/suite.json": b"{}",
    }
    for name, content in kept.items():
        write(folder, name, content)
    for name in ("suite/records/a.json", "lessons/team-1/checkpoints/1.safetensors", "picture.png", ".rest.json"):
        write(folder, name, b"")
    pack_parts(folder, path)
    again = tmp_path / "deep" / "again"
    unpack_parts(path, again)
    found = {file.relative_to(again).as_posix(): file.read_bytes() for file in again.rglob("*") if file.is_file()}
    assert found == kept
    assert [each.name for each in again.parent.iterdir()] == ["again"]
    first = path.read_bytes()
    pack_parts(again, path)
    assert path.read_bytes() == first


def test_a_folder_with_files_is_left_alone_and_no_archive_is_none(tmp_path):
    write(tmp_path / "runs", "runs.jsonl", lines("a"))
    pack_parts(tmp_path / "runs", tmp_path / "parts.zip")
    write(tmp_path / "other", "runs.jsonl", lines("b", "a"))
    unpack_parts(tmp_path / "parts.zip", tmp_path / "other")
    unpack_parts(tmp_path / "none.zip", tmp_path / "empty")
    assert (tmp_path / "other" / "runs.jsonl").read_bytes() == lines("b", "a")
    assert not (tmp_path / "empty").exists()


@pytest.mark.parametrize(("name", "keys", "lost"), [("runs.jsonl", "b", "'a'"), ("other.jsonl", "ab", "'runs.jsonl'")])
def test_an_archive_with_more_is_not_replaced(tmp_path, name, keys, lost):
    write(tmp_path / "runs", "runs.jsonl", lines("a", "b"))
    path = tmp_path / "parts.zip"
    pack_parts(tmp_path / "runs", path)
    before = path.read_bytes()
    write(tmp_path / "less", name, lines(*keys))
    for act in (lambda: pack_parts(tmp_path / "less", path), lambda: unpack_parts(path, tmp_path / "less")):
        with pytest.raises(ValueError, match=rf"parts.zip has {lost}, which .*less lacks; choose another file"):
            act()
    assert path.read_bytes() == before


@pytest.mark.parametrize("name", ["../out.json", "/out.json", "a\\b.json", "program.py"])
def test_other_archives_are_refused_before_anything_is_written(tmp_path, name):
    with zipfile.ZipFile(tmp_path / "parts.zip", "w") as archive:
        archive.writestr("runs.jsonl", lines("a"))
        archive.writestr(name, "")
    with pytest.raises(ValueError, match="want one that lidarium reproduce --parts wrote"):
        unpack_parts(tmp_path / "parts.zip", tmp_path / "runs")
    (tmp_path / "damaged.zip").write_bytes((tmp_path / "parts.zip").read_bytes()[:-30])
    with pytest.raises(ValueError, match=r"damaged.zip is not an archive of finished parts"):
        unpack_parts(tmp_path / "damaged.zip", tmp_path / "deep" / "runs")
    assert sorted(each.name for each in tmp_path.iterdir()) == ["damaged.zip", "parts.zip"]


def test_a_line_that_was_cut_off_hinders_nobody(tmp_path):
    write(tmp_path / "runs", "runs.jsonl", lines("a"))
    pack_parts(tmp_path / "runs", tmp_path / "parts.zip")
    write(tmp_path / "runs", "runs.jsonl", lines("a") + b'{"key": "b')
    unpack_parts(tmp_path / "parts.zip", tmp_path / "runs")
    assert (tmp_path / "runs" / "runs.jsonl").read_bytes() == lines("a") + b'{"key": "b'
