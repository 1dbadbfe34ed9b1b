"""Networks beside classic tours."""

import json

import pytest

from lidarium.training.settings import training_of
from lidarium.training.validation import CLASSIC, compared, validation_suite

TRAINING = {"settings": {"resolution": 0.1, "stop_coverage": 0.9, "horizon_s": 100.0}}


def episode(policy, floor, robots, time_s, coverage=0.9):
    key = f"{policy} {floor} {robots}"
    row = {"key": key, "policy": policy, "floor": floor, "robots": robots, "seed": 0}
    return {**row, "time_s": time_s, "coverage_final": coverage, "t99_s": None}


def written(folder, *episodes):
    (folder / "episodes.jsonl").write_text("".join(json.dumps(row) + "\n" for row in episodes))
    return folder


def test_times_are_compared_in_pairs(tmp_path):
    folder = written(
        tmp_path,
        episode(CLASSIC, "a", 1, 40.0),
        episode("mine", "a", 1, 20.0),
        episode(CLASSIC, "b", 2, 10.0),
        episode("mine", "b", 2, 20.0),
        episode(CLASSIC, "c", 2, 10.0),
        episode("mine", "c", 2, 20.0),
        episode("other", "c", 2, 1.0),
        episode(CLASSIC, "d", 2, 1.0),
    )
    found = compared(folder, "mine", training_of(TRAINING))
    assert found.ratio == pytest.approx(2.0 ** (1 / 3))
    assert found.by_robots == pytest.approx({"1": 0.5, "2": 2.0})
    assert found.better == pytest.approx(1 / 3)
    assert (found.ended, found.classic_ended, found.episodes) == (3, 3, 3)


def test_who_does_not_see_enough_needs_the_whole_horizon(tmp_path):
    """Enough is what the settings say, whatever thresholds there are."""
    folder = written(tmp_path, episode(CLASSIC, "a", 1, 50.0, 0.9), episode("mine", "a", 1, 30.0, coverage=0.89))
    found = compared(folder, "mine", training_of(TRAINING))
    assert found.ratio == pytest.approx(2.0)
    assert (found.ended, found.classic_ended) == (0, 1)


def test_without_a_pair_there_is_nothing_to_compare(tmp_path):
    folder = written(tmp_path, episode(CLASSIC, "a", 1, 50.0), episode("mine", "b", 1, 30.0))
    with pytest.raises(ValueError, match="no episodes of mine beside tour_frontier"):
        compared(folder, "mine", training_of(TRAINING))


def test_the_suite_holds_classic_tours_and_all_networks(tmp_path):
    assert validation_suite(training_of(TRAINING), {}).policies == (CLASSIC,)
    suite = validation_suite(training_of({**TRAINING, "validation": {"floors": ["apartment:7"]}}), {})
    assert suite.settings("default", 2).stop_coverage == 0.9
    with pytest.raises(FileNotFoundError, match=r"nowhere\.safetensors"):
        validation_suite(training_of(TRAINING), {"mine": tmp_path / "nowhere.safetensors"})


def test_a_floor_that_is_not_there_is_named():
    training = training_of({"validation": {"floors": ["castle:3"]}})
    with pytest.raises((ValueError, FileNotFoundError), match="castle:3"):
        validation_suite(training, {})
