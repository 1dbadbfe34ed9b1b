"""The study of learned explorers: its suites."""

from pathlib import Path

from lidarium.benchmarks.studies import learned
from lidarium.mapping.prediction.network_predictor import NetworkPredictor


def test_suites_run_all_floors_for_the_learned_and_a_part_for_the_others(monkeypatch):
    monkeypatch.chdir(Path(__file__).parents[4])  # where the weights for predicted maps are
    suites = learned.suites(None, 20)
    assert suites["test"].policies == ("tour_frontier", "learned", "learned_predicted")
    assert isinstance(suites["test"].make_policy("learned_predicted").predictor, NetworkPredictor)
    assert len(suites["test"].floors) == 10
    assert suites["test_classic"].policies == learned.CLASSICS
    assert set(suites["test_classic"].floors) <= set(suites["test"].floors)
    assert suites["test"].robots == (1, 2, 3)


def test_without_the_weights_for_predicted_maps_the_others_run(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    assert learned.suites(None, 20)["test"].policies == ("tour_frontier", "learned")
