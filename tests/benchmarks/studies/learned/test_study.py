"""The study of learned explorers: its suites."""

from lidarium.benchmarks.studies import learned


def test_suites_run_all_floors_for_the_two_and_a_part_for_the_others():
    suites = learned.suites(None, 20)
    assert suites["test"].policies == ("tour_frontier", "learned")
    assert len(suites["test"].floors) == 10
    assert suites["test_classic"].policies == learned.CLASSICS
    assert set(suites["test_classic"].floors) <= set(suites["test"].floors)
    assert suites["test"].robots == (1, 2, 3)
