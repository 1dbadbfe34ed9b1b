"""Tables of learned explorers beside classic ones."""

import pytest
from published_pages import assert_published, keep

from lidarium.benchmarks.studies import learned


def episode(t99_s, path_m=10.0):
    return {"t99_s": t99_s, "path_m": [path_m]}


@pytest.fixture
def episodes():
    floors = [(f"f{number}", 1) for number in range(8)]
    return {
        "tour_frontier": {key: episode(100.0) for key in floors},
        "learned": {key: episode(80.0 + k, 8.0) for k, key in enumerate(floors)},
        "learned_tours": {key: episode(90.0 + k, 8.0) for k, key in enumerate(floors)},
        "nearest_frontier": {key: episode(200.0) for key in floors[:4]},
        "utility_frontier": {key: episode(150.0) for key in floors[:4]},
        "explore_lite": {key: episode(None) for key in floors[:4]},
    }


def test_a_row_compares_pairs(episodes):
    cells = learned._cells(episodes, "learned", "tour_frontier", 1)
    assert cells[:4] == ("1", "`learned`", "`tour_frontier`", "8")
    assert cells[4].startswith("0.835 (")
    assert cells[6:] == ("100 %", "8, 8", "0.800")
    assert learned._cells(episodes, "learned", "tour_frontier", 2) == ()


def test_means_have_a_row_for_each_kind_and_team_that_ran(episodes):
    (row,) = learned.means_table({"test": episodes, "kth": {}}).splitlines()[2:]
    cells = [cell.strip() for cell in row.strip("|").split("|")]
    assert cells[:3] == [learned.KINDS["test"], "1", "8"]
    assert cells[3].startswith("0.835 (")
    assert cells[4].startswith("0.935 (")
    assert cells[5].startswith("0.667 (")
    assert cells[5].endswith(", `utility_frontier`")
    assert learned.times_table({"test": episodes}).count("\n| generated") == 4


def test_two_pairs_are_too_few_for_an_interval(episodes):
    few = {policy: dict(list(of_policy.items())[:2]) for policy, of_policy in episodes.items()}
    cells = learned._cells(few, "learned", "tour_frontier", 1)
    assert cells[4] == "0.805 (no interval)"
    assert "inf" not in " ".join(cells)


def test_the_best_classic_has_the_least_mean_and_the_horizon_counts(episodes):
    assert learned.best_classic(episodes, 1) == "utility_frontier"
    assert learned.best_classic(episodes, 3) is None


def test_bounds_say_what_is_saved(episodes):
    bounds = [{"floor": f"f{number}", "robots": 1, "known_s": 60.0} for number in range(2)]
    bounds.append({"floor": "f3", "robots": 1, "known_s": None})
    lines = learned.bounds_table(bounds, episodes).splitlines()
    cells = [cell.strip() for cell in lines[-1].strip("|").split("|")]
    assert cells == ["1", "2", "3.33", "2.50", "30.00", "1.67", "1.51", "1.34", "49 %"]
    assert learned.bounds_table([], episodes).startswith("No floor")


def test_kinds_that_did_not_run_are_named():
    assert learned.missing_text([]) == ""
    assert "LIFULL apartments" in learned.missing_text(["slam", "lifull"])


def test_what_sends_the_robots_is_summed_over_runs(episodes):
    runs = list(episodes["learned"].values())
    runs[0]["decided_by"] = {"tours": 6, "corrected": 2}
    runs[1]["decided_by"] = {"tours": 7, "corrected": 3, "predicted": 4, "nearest": 3}
    lines = learned.senders_table({"test": episodes}).splitlines()
    cells = [cell.strip() for cell in lines[-1].strip("|").split("|")]
    assert cells == [learned.KINDS["test"], "1", "12.5", "52.0 %", "20.0 %", "16.0 %", "12.0 %", "50 %"]
    assert learned.senders_table({"kth": {}}) == "No run says."


def test_the_page_of_stored_figures_is_that_which_is_published(episodes, tmp_path):
    for kind in learned.KINDS:
        lines = [
            {
                "key": f"default | {floor} | {robots} | seed 0 | {policy}",
                "policy": policy,
                "robots": robots,
                "decided_by": {"tours": 3},
                **each,
            }
            for policy, of_policy in episodes.items()
            for (floor, robots), each in of_policy.items()
        ]
        keep(tmp_path / kind / "episodes.jsonl", lines)
    keep(tmp_path / learned.BOUNDS_FILE, [{"floor": "f0", "robots": 1, "known_s": 60.0}])
    assert_published("learned", learned.page(tmp_path), tmp_path)
