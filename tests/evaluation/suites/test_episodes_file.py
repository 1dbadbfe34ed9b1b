"""What has been written stays, whenever the writer dies; what is wrong is told."""

import json
import os
import random
import shutil
import subprocess
import sys
import time

import pytest

from lidarium.evaluation.suites.episodes_file import EpisodesFile, read_episodes

WRITER = """
import sys
from pathlib import Path
from lidarium.evaluation.suites.episodes_file import EpisodesFile
with EpisodesFile(Path(sys.argv[1])) as file:
    known = {episode["key"] for episode in file.episodes}
    print("ready", flush=True)
    for number in range(10**6):
        if str(number) not in known:
            file.append({"key": str(number), "number": number, "text": "x" * (number * 37 % 5000)})
"""


def episode(number, **more):
    return {"key": str(number), "number": number, **more}


def test_what_is_appended_is_read(tmp_path):
    path = tmp_path / "deep" / "episodes.jsonl"
    assert read_episodes(path) == []
    with EpisodesFile(path) as file:
        file.append(episode(1))
        assert read_episodes(path) == [episode(1)]
        file.append(episode(2))
    with EpisodesFile(path) as file:
        assert file.episodes == [episode(1), episode(2)]


def test_a_last_line_that_was_cut_off_is_dropped_with_a_warning(tmp_path):
    path = tmp_path / "episodes.jsonl"
    whole = json.dumps(episode(1)) + "\n"
    path.write_text(whole + json.dumps(episode(2))[:-3])
    with pytest.warns(UserWarning, match="line 2.*cut off"):
        assert read_episodes(path) == [episode(1)]
    with pytest.warns(UserWarning, match="cut off"), EpisodesFile(path) as file:
        file.append(episode(3))
    assert read_episodes(path) == [episode(1), episode(3)]


def test_a_whole_last_line_without_its_end_is_kept(tmp_path):
    path = tmp_path / "episodes.jsonl"
    path.write_text(json.dumps(episode(1)))
    with EpisodesFile(path) as file:
        file.append(episode(2))
    assert read_episodes(path) == [episode(1), episode(2)]


@pytest.mark.parametrize("line", ["{", "[1]", '{"number": 1}', '{"key": 3}'])
def test_a_bad_line_within_is_refused_and_left(tmp_path, line):
    path = tmp_path / "episodes.jsonl"
    content = f"{json.dumps(episode(1))}\n{line}\n{json.dumps(episode(2))}\n"
    path.write_text(content)
    for opened in (read_episodes, EpisodesFile):
        with pytest.raises(ValueError, match="line 2"):
            opened(path)
    assert path.read_text() == content


def test_the_same_episode_twice_counts_once_and_two_ends_of_it_are_refused(tmp_path):
    path = tmp_path / "episodes.jsonl"
    lines = [episode(1, steps_per_s=5.0), episode(2), episode(1, steps_per_s=7.0)]
    path.write_text("".join(json.dumps(line) + "\n" for line in lines))
    with pytest.warns(UserWarning, match="line 3.*counted once"):
        assert read_episodes(path) == lines[:2]
    path.write_text(path.read_text() + json.dumps(episode(2, coverage=1.0)) + "\n")
    with (
        pytest.warns(UserWarning, match="counted once"),
        pytest.raises(ValueError, match=r"line 4.*another end"),
    ):
        read_episodes(path)


def test_there_is_one_writer_at_a_time(tmp_path):
    path = tmp_path / "episodes.jsonl"
    with EpisodesFile(path) as file:
        with pytest.raises(ValueError, match="another process"):
            EpisodesFile(path)
        file.append(episode(1))
    with EpisodesFile(path) as file:
        assert len(file.episodes) == 1


def test_a_full_disk_leaves_the_file_as_it_was(tmp_path, monkeypatch):
    path = tmp_path / "episodes.jsonl"
    with EpisodesFile(path) as file:
        file.append(episode(1))
        before = path.read_bytes()
        with monkeypatch.context() as patched:
            write = sys.modules["os"].write
            patched.setattr("os.write", lambda handle, content: write(handle, content[:5]))
            with pytest.raises(OSError, match=r"full.*goes on from there"):
                file.append(episode(2))
        assert path.read_bytes() == before
        file.append(episode(3))
    assert read_episodes(path) == [episode(1), episode(3)]


@pytest.mark.parametrize("change", ["removed", "folder removed", "replaced", "linked"])
def test_what_is_written_into_nothing_is_told(tmp_path, change):
    """The fault that was found: episodes went on into a file that no longer had a name."""
    path = tmp_path / "out" / "episodes.jsonl"
    with EpisodesFile(path) as file:
        file.append(episode(1))
        if change == "folder removed":
            shutil.rmtree(path.parent)
        else:
            path.unlink()
        if change == "replaced":
            path.write_text("another")
        if change == "linked":
            path.symlink_to(tmp_path / "elsewhere")
        with pytest.raises(OSError, match="while episodes were written"):
            file.append(episode(2))
        with pytest.raises(OSError, match="while episodes were written"):
            file.check_in_place()


def test_a_disk_that_cannot_even_be_tidied_up_is_told_as_what_it_is(tmp_path, monkeypatch):
    path = tmp_path / "episodes.jsonl"

    def refuse(*_):
        raise OSError(5, "Input/output error")

    with EpisodesFile(path) as file:
        file.append(episode(1))
        with monkeypatch.context() as patched:
            patched.setattr("os.fsync", refuse)
            patched.setattr("os.ftruncate", refuse)
            with pytest.raises(OSError, match=r"Input/output error; the episodes before"):
                file.append(episode(2))
    assert read_episodes(path)[0] == episode(1)


FOREIGN = [
    b"notes of mine",
    b"\x1f\x8b\x08 packed",
    b'{"episode": 1, "reward": 0.5',
    b'{"key": "1"}\nand so on',
    b'{"keys": 1}\n{"k',
    b"{}\n",
]


@pytest.mark.parametrize("content", FOREIGN)
def test_a_file_that_no_writer_of_episodes_made_is_refused_and_left(tmp_path, content):
    path = tmp_path / "episodes.jsonl"
    path.write_bytes(content)
    with pytest.raises(ValueError, match=r"episodes\.jsonl"):
        EpisodesFile(path)
    assert path.read_bytes() == content


@pytest.mark.filterwarnings("ignore:.*cut off")
@pytest.mark.parametrize("rest", [b'{"', b'{"key', b'{"key":"2","pa', b'{"key": "2', bytes(512)])
def test_the_beginning_of_an_episode_and_zeros_of_a_broken_disk_are_dropped(tmp_path, rest):
    path = tmp_path / "episodes.jsonl"
    whole = json.dumps(episode(1)).encode() + b"\n"
    path.write_bytes(whole + rest)
    with EpisodesFile(path) as file:
        assert file.episodes == [episode(1)]
    assert path.read_bytes() == whole


@pytest.mark.skipif(os.name == "nt", reason="links and pipes are those of Unix")
def test_links_and_pipes_are_refused(tmp_path):
    (tmp_path / "theirs").write_text("")
    (tmp_path / "link.jsonl").symlink_to(tmp_path / "theirs")
    os.mkfifo(tmp_path / "pipe.jsonl")
    for name, what in (("link.jsonl", "is a link"), ("pipe.jsonl", "no plain file")):
        with pytest.raises(ValueError, match=what):
            EpisodesFile(tmp_path / name)


@pytest.mark.parametrize("bad", [{}, {"key": 3}, {"key": "1", "number": float("nan")}])
def test_what_is_no_episode_is_not_written(tmp_path, bad):
    with (
        EpisodesFile(tmp_path / "episodes.jsonl") as file,
        pytest.raises(ValueError, match=r"key|Out of range"),
    ):
        file.append(bad)
    assert (tmp_path / "episodes.jsonl").read_bytes() == b""


@pytest.mark.filterwarnings("ignore:.*cut off")
def test_a_writer_that_is_killed_at_any_moment_loses_and_doubles_nothing(tmp_path):
    path, generator = tmp_path / "episodes.jsonl", random.Random(0)
    for _ in range(20):
        before = read_episodes(path)
        process = subprocess.Popen([sys.executable, "-c", WRITER, str(path)], stdout=subprocess.PIPE)
        assert process.stdout.readline() == b"ready\n"
        time.sleep(generator.uniform(0.0, 0.02))
        process.kill()
        process.communicate()
        after = read_episodes(path)
        assert after[: len(before)] == before
        assert [line["number"] for line in after] == list(range(len(after)))
    assert len(after) > 20
