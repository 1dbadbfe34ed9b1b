"""Answers, names and progress of all commands."""

import itertools
import os
import sys
from types import SimpleNamespace

import pytest

from lidarium.envs.settings.making import make_settings
from lidarium.scripts.common import Command, Progress, TeamCommand, counted, file_name, notify, table


def test_progress_is_a_line_every_few_seconds_where_there_is_no_terminal(capsys):
    times = iter([0.0, 1.0, 6.0])
    progress = Progress(is_quiet=False, clock=lambda: next(times))
    env = SimpleNamespace(scorer=SimpleNamespace(coverage=0.5, time=12.0))
    for _ in range(3):
        progress.show(env)
    progress.close()
    assert capsys.readouterr().err == "explored 50.0 %, simulated 12 s\n" * 2


@pytest.mark.skipif(os.name == "nt", reason="streams are closed as on Unix")
def test_work_goes_on_where_nobody_reads_its_messages(monkeypatch):
    reading, writing = os.pipe()
    os.close(reading)
    with os.fdopen(writing, "w", buffering=1) as stream:
        monkeypatch.setattr(sys, "stderr", stream)
        notify("explored 50 %")
        notify("explored 60 %")
        monkeypatch.undo()
        os.dup2(os.open(os.devnull, os.O_WRONLY), writing)
    monkeypatch.setattr(sys, "stderr", stream)
    notify("the stream is closed now")


def test_columns_of_numbers_are_aligned_to_the_right():
    assert table([("a", 5), ("bcd", 12)], ("name", "count")).splitlines() == [
        "  name  count",
        "  a         5",
        "  bcd      12",
    ]
    assert table([("a", "x"), ("bcd", "")], indent="").splitlines() == ["a    x", "bcd"]
    assert table([], ("name",)).strip() == "name"
    assert table([]) == ""


@pytest.mark.parametrize(
    ("name", "shown"),
    [("a/b c", "a-b-c"), ("../x.", "x"), ("", "floor"), ("..", "floor"), ("B\u00fcro_1", "B\u00fcro_1")],
)
def test_a_name_becomes_part_of_a_files_name(name, shown):
    assert file_name(name) == shown


def test_items_are_passed_on_and_counted_every_few_seconds(capsys):
    times = iter([0.0, 1.0, 6.0, 7.0, 20.0])
    assert list(counted("abcd", 1234, "files", is_quiet=True, clock=lambda: next(times))) == list("abcd")
    assert capsys.readouterr().err == "files: 2 of 1,234\nfiles: 4 of 1,234\n"


def test_options_that_were_left_out_are_left_to_the_realism():
    assert TeamCommand().team_options == {
        "robot": "kobuki",
        "realism": "ideal",
        "resolution": 0.025,
    }
    given = TeamCommand(radio="none", unknown_starts=True, set=("reward.time=0.02",), realism="lab")
    settings = make_settings(**given.team_options)
    assert settings.reward.time == 0.02
    assert not settings.known_starts
    assert settings.radio == make_settings(radio="none").radio != make_settings(realism="lab").radio


def test_a_seed_below_0_is_refused():
    with pytest.raises(ValueError, match="seed is -1; want zero or more"):
        Command(seed=-1)


@pytest.mark.parametrize("is_terminal", [False, True])
def test_what_earlier_calls_did_counts_too(capsys, monkeypatch, is_terminal):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: is_terminal, raising=False)
    finished = iter([8, 9, 10])
    times = itertools.count(0.0, 10.0)
    list(counted("abc", 10, "files", is_quiet=False, clock=lambda: next(times), done=lambda: next(finished)))
    shown = capsys.readouterr().err
    assert ("files:" in shown and "0/10" in shown) if is_terminal else shown.startswith("files: 8 of 10\nfiles: 9 of")
