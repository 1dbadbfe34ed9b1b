"""`lidarium animate` writes the film of `lidarium run --gif` as merging.webp, until release 0.3."""

import json

import imageio.v3 as imageio

from lidarium.scripts.main import main

SHORT = ["--robots", "2", "--horizon-s", "3"]


def test_a_short_film_can_be_read(tmp_path, capsys):
    assert main(["animate", *SHORT, "--json", "--out", str(tmp_path)]) == 0
    printed = capsys.readouterr()
    assert "`lidarium run --gif` makes this film" in printed.err
    told = json.loads(printed.out)
    path = tmp_path / "merging.webp"
    frames = imageio.imread(path, index=...)
    assert told["file"] == str(path)
    assert told["size_bytes"] == path.stat().st_size
    assert frames.ndim == 4
    assert 3 <= len(frames) <= 9
    assert frames.shape[2] <= 640
    assert (frames[0] != frames[-1]).any()


def test_a_film_lasts_as_long_as_is_said(tmp_path, capsys):
    assert main(["animate", *SHORT, "--speed", "10", "--json", "--out", str(tmp_path)]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["film_s"] == 1.9
    assert told["joined_at_s"] == []


def test_bad_options_are_refused(tmp_path, capsys):
    assert main(["animate", "--robots", "1", "--out", str(tmp_path)]) == 2
    assert main(["animate", "--speed", "0", "--out", str(tmp_path)]) == 2
    assert "want" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
