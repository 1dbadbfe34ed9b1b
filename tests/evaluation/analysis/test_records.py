"""Records of episodes, as far as a report keeps them."""

import numpy as np
import pytest

from lidarium.evaluation.analysis.records import coverage_at, read_records, read_track, record_key


def test_coverage_holds_from_each_change_on():
    coverage = np.array([[0.0, 0.1], [2.0, 0.4], [3.0, 0.9]])
    assert coverage_at(coverage, np.array([0.0, 1.9, 2.0, 10.0])).tolist() == [0.1, 0.1, 0.4, 0.9]


def test_a_record_of_another_episode_is_left_out_and_named(episodes_folder, rows):
    found, warnings = read_records(episodes_folder, rows)
    assert list(found) == [row["record"] for row in rows]
    assert warnings == []
    other = [{**rows[0], "record": rows[1]["record"]}]
    found, (warning,) = read_records(episodes_folder, other)
    assert found == {}
    assert warning.endswith("it is of an episode with another seed.")


def test_episodes_without_a_record_have_none(episodes_folder, rows):
    without = [{**rows[0], "record": None}, {**rows[0], "record": "records/none.npz"}]
    assert read_records(episodes_folder, without) == ({}, [])
    assert record_key({}) == record_key({"record": None}) == ""


def test_a_track_is_that_of_the_record(episodes_folder, rows):
    found, _ = read_records(episodes_folder, rows[:1])
    (entry,) = found.values()
    track = read_track(entry)
    assert track.poses.shape == (len(track.times), 2, 3)
    assert set(np.unique(track.levels)) == {0, 127, 255}
    assert entry.coverage[-1, 1] == pytest.approx(rows[0]["coverage_final"], abs=1e-6)


def test_records_are_found_of_floors_that_only_a_hash_tells_apart(episodes_folder, rows):
    told = {**rows[0], "floor": f"{rows[0]['floor']} ({rows[0]['floor_sha256'][:6]})"}
    assert list(read_records(episodes_folder, [told])[0]) == [rows[0]["record"]]
