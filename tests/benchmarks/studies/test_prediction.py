"""The study of predicted maps: its suites and tables."""

import pytest

from lidarium.benchmarks.studies import prediction
from lidarium.training.prediction.quality import BINS


def test_suites_run_tours_beside_network_and_truth():
    suite = prediction.suites(None, 50)["test"]
    assert suite.policies == ("tour_frontier", "predicted", "true")
    assert len(suite.floors) == 4
    assert suite.policy_settings["true"]["predictor"] == "truth"


def test_times_are_ratios_of_pairs():
    floors = [(f"f{number}", 1) for number in range(6)]
    episodes = {
        "tour_frontier": dict.fromkeys(floors, 100.0),
        "predicted": {key: 90.0 + k for k, key in enumerate(floors)},
        "true": dict.fromkeys(floors[:1], 50.0),
    }
    row = prediction.times_table(episodes, "test").splitlines()[-3]
    cells = [cell.strip() for cell in row.strip("|").split("|")]
    assert cells[:2] == ["1", "6"]
    assert cells[2].startswith("0.925 (")
    assert cells[3:] == ["100 %", "-", "-"]


def test_families_are_summed():
    counts = [100.0, 10.0, 40.0, 20.0] + [0.0] * (3 * BINS)
    counts[4 + 9], counts[4 + BINS + 9], counts[4 + 2 * BINS + 9] = 100.0, 95.0, 90.0
    lines = [{"family": "home", "maps": 5, "counts": counts}] * 2
    row = prediction.quality_table(lines).splitlines()[-1]
    assert row == "| home | 10 | 200 | 10.0 % | 40.0 % | 20.0 % | 50 % | 0.050 |"


@pytest.mark.parametrize("family", prediction.FAMILIES)
def test_every_family_has_floors(family):
    floor = prediction.Mapped(family, 0).floor
    assert isinstance(floor, str) or floor.solids
