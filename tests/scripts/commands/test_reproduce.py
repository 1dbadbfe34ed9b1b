"""Parts of a study that are asked for, and the command that a page names."""

import importlib.util
from dataclasses import dataclass
from pathlib import Path

import pytest

from lidarium.benchmarks import studies
from lidarium.benchmarks.studies.shared.study import Study, Task, do_missing, kept_lines
from lidarium.scripts.commands.reproduce import Reproduce, _command_line, _every, _worked, execute
from lidarium.scripts.common import INTERRUPTED


@pytest.mark.parametrize(
    ("options", "every", "words"),
    [
        ({}, 1, ""),
        ({"every": 10}, 10, " --every 10"),
        ({"share": 0.1}, 10, " --share 0.1"),
        ({"share": 1.0}, 1, " --share 1"),
        ({"quick": True}, 30, " --quick"),
        ({"data": Path("/home/me/data"), "every": 2}, 2, " --data data --every 2"),
        ({"data": Path("shared/data")}, 1, " --data shared/data"),
    ],
)
def test_a_share_is_every_so_many(options, every, words):
    command = Reproduce(name="floors", **options)
    assert _every(command, 30) == every
    assert _command_line(command) == f"lidarium reproduce floors{words}"


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"every": 0}, "--every is 0"),
        ({"workers": -1}, "--workers -1"),
        ({"share": 0.5, "every": 2}, "want one of them"),
        ({"quick": True, "every": 2}, "want one of them"),
        ({"share": 0.0}, "want a share above 0, up to 1"),
        ({"share": 1.5}, "want a share above 0, up to 1"),
    ],
)
def test_bad_parts_are_refused_before_anything_is_written(options, message, tmp_path):
    with pytest.raises(ValueError, match=message):
        execute(Reproduce(name="floors", out=tmp_path / "out", runs=tmp_path / "runs", **options))
    assert list(tmp_path.iterdir()) == []


def test_a_study_whose_packages_are_missing_says_so_before_it_runs(tmp_path, monkeypatch):
    find = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == "ortools" else find(name))
    with pytest.raises(ValueError, match=r"the study bounds needs ortools: pip install .*bounds"):
        execute(Reproduce(name="bounds", out=tmp_path / "out", runs=tmp_path / "runs"))
    assert not list(tmp_path.iterdir())


def test_work_shows_each_new_part_and_ends_where_it_is_broken_off(capsys):
    def work(breaks):
        yield "maps", 1, 9
        yield "maps", 2, 9
        if breaks:
            raise KeyboardInterrupt
        yield "logs", 3, 3

    assert _worked(work(breaks=False), is_quiet=False)
    assert capsys.readouterr().err == "maps: 1 of 9\nlogs: 3\n"
    assert not _worked(work(breaks=True), is_quiet=True)
    assert capsys.readouterr().err == ""


@dataclass(frozen=True)
class Square(Task):
    """A part of a small study."""

    number: int


def test_an_interrupted_study_goes_on_in_another_folder_from_its_parts(tmp_path, monkeypatch):
    done = []

    def measure(square):
        if len(done) == 2 and not (tmp_path / "parts.zip").exists():
            raise KeyboardInterrupt
        done.append(square.number)
        return {"square": square.number**2}

    def work(folder, _data, _every, workers):
        yield from do_missing(folder / "squares.jsonl", "squares", [Square(k) for k in range(4)], measure, workers)

    def page(folder):
        return f"# Squares\n\n{[line['square'] for line in kept_lines(folder / 'squares.jsonl')]}\n"

    monkeypatch.setattr(studies, "STUDIES", {"squares": Study(page, work=work)})
    asked = {"name": "squares", "out": tmp_path / "out", "parts": tmp_path / "parts.zip", "workers": 1}
    assert execute(Reproduce(**asked, runs=tmp_path / "first")).code == INTERRUPTED
    assert execute(Reproduce(**asked, runs=tmp_path / "second")).code == 0
    assert done == [0, 1, 2, 3]
    assert "[0, 1, 4, 9]" in (tmp_path / "out" / "squares.md").read_text()
    assert execute(Reproduce(**asked, runs=tmp_path / "third")).code == 0
    assert done == [0, 1, 2, 3]
