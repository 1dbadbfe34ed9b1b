"""The files of a run."""

import json

import cv2
import pytest
from short_runs import short_run

from lidarium.evaluation.record import Recorder, read_record
from lidarium.scripts.output.run_files import write_run


@pytest.mark.parametrize("is_recorded", [False, True])
def test_all_files_that_are_named_are_there_and_no_others(tmp_path, is_recorded):
    recorder = Recorder("nearest_frontier", 0, "apartment") if is_recorded else None
    episode = short_run(watchers=[recorder] if is_recorded else [])
    files = write_run(tmp_path, episode, {"a": 1}, recorder, "nearest_frontier", [])
    assert sorted(files) == sorted(path.name for path in tmp_path.iterdir())
    assert ("episode.npz" in files) == is_recorded
    assert json.loads((tmp_path / "result.json").read_text()) == {"a": 1}
    assert cv2.imread(str(tmp_path / "run.png")) is not None
    if is_recorded:
        assert read_record(tmp_path / "episode.npz").header["policy"] == "nearest_frontier"


def test_a_film_that_is_not_there_is_missed(tmp_path):
    with pytest.raises(OSError, match=r"run\.mp4"):
        write_run(tmp_path, short_run(), {}, None, "nearest_frontier", ["run.mp4"])
