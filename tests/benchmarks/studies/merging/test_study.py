import json

import pytest
from published_pages import assert_published

from lidarium.benchmarks.studies import STUDIES
from lidarium.benchmarks.studies.merging import features, trials
from lidarium.benchmarks.studies.merging import study as merging
from lidarium.benchmarks.studies.merging.bank import bank, drives, making
from lidarium.benchmarks.studies.merging.bank.floors import BankFloor
from lidarium.benchmarks.studies.merging.bank.pairs import Wanted
from lidarium.evaluation.processes import shared_out

FLOORS = [
    BankFloor("scene_room", "tuning", "drawn"),
    BankFloor("scene_corner", "test", "drawn"),
    BankFloor("scene_room_corner", "test", "drawn"),
]


@pytest.fixture
def small_bank(monkeypatch):
    few = Wanted(plenty=1, little=1, negative=1, like_places=1, copies=1, indistinct=1)
    monkeypatch.setattr(merging, "bank_floors", lambda data, every: FLOORS)
    monkeypatch.setattr(merging, "STRUCTURE_FLOORS", 1)
    monkeypatch.setattr(features, "REPEATS", 1)
    for module in (merging, trials):
        # What is patched here holds in this process alone.
        monkeypatch.setattr(module, "shared_out", lambda work, tasks, workers, is_apart: shared_out(work, tasks, 1))
    monkeypatch.setattr(bank, "RUNS", 1)
    monkeypatch.setattr(drives, "HORIZON_S", 10.0)
    monkeypatch.setattr(making, "Wanted", lambda: few)


def test_the_page_has_all_experiments_and_what_is_done_is_not_done_again(small_bank, tmp_path, monkeypatch):
    study = STUDIES["merging"]
    assert study.suites(None, 1) == {}
    done = list(study.work(tmp_path, None, 1, 1))
    assert ("drives", 9, 9) in done
    assert done[-1] == ("other experiments", 10, 10)
    again = list(study.work(tmp_path, None, 1, 1))
    assert all(what.startswith("pairs") for what, *_ in again)
    extra = json.loads((tmp_path / merging.EXTRA_FILE).read_text())
    # The small bank has no apartment, and positives at best.
    stage = {"corners": 9.0, "repeated": 0.5, "matches": 4, "right": 3, "discs_at_truth": 0.7, "is_joined": False}
    pair = {"pair": "A1-B1", "overlap": 0.5, "matches": 4, "inliers": 3, "agreement": 80.0, "time_us": 9.0}
    matched = {"method": "radius", "pairs": 1, "matches": 9, "right": 1, "two_right": 0, "voted": 0, "time_ms": 1.0}
    extra |= {"stages": [stage], "twelve": [{**pair, "is_accepted": False, "error_m": None}], "methods": [matched]}
    (tmp_path / merging.EXTRA_FILE).write_text(json.dumps(extra))
    page = study.page(tmp_path)
    assert_published("merging", page, tmp_path, ("Maps of real robots", "Drawn plans", "Regions and doors"))
    for heading in (
        "The bank",
        "Beside the thesis's bank",
        "Why the thesis's rules join so little",
        "Detectors",
        "Descriptors",
        "Matching",
        "Five robots",
    ):
        assert f"## {heading}" in page
    assert "nan" not in page.split("## Detectors")[1]
    study.pictures(tmp_path, tmp_path / "out")
    assert (tmp_path / "out" / "merging_pairs.png").stat().st_size > 1000
    monkeypatch.setattr(merging, "bank_floors", lambda data, every: FLOORS[:2])
    with pytest.raises(ValueError, match="a bank of other floors"):
        next(study.work(tmp_path, None, 1, 1))
