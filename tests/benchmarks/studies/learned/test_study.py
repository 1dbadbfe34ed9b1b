"""The study of learned explorers: its suites."""

from pathlib import Path

from lidarium.benchmarks.studies import learned


def test_suites_run_all_floors_for_the_learned_and_a_part_for_the_others(monkeypatch):
    monkeypatch.chdir(Path(__file__).parents[4])  # where the first weights are
    suites = learned.suites(None, 20)
    assert suites["test"].policies == ("tour_frontier", "learned", "learned_tours")
    made = {name: suites["test"].make_policy(name) for name in ("learned", "learned_tours")}
    assert [name for name, policy in made.items() if policy.predicts] == ["learned"]
    assert len(suites["test"].floors) == 10
    assert suites["test_classic"].policies == learned.CLASSICS
    assert set(suites["test_classic"].floors) <= set(suites["test"].floors)
    assert suites["test"].robots == (1, 2, 3)


def test_without_the_first_weights_the_others_run(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    assert learned.suites(None, 20)["test"].policies == ("tour_frontier", "learned")
