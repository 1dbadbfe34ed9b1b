
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
    few = Wanted(plenty=3, little=1, negative=2, like_places=1, copies=1, indistinct=1)
    monkeypatch.setattr(merging, "bank_floors", lambda data, every: FLOORS)
    monkeypatch.setattr(merging, "STRUCTURE_FLOORS", 1)
    monkeypatch.setattr(features, "REPEATS", 1)
    for module in (merging, trials):
        # What is patched here holds in this process alone.
        monkeypatch.setattr(module, "shared_out", lambda work, tasks, workers, is_apart: shared_out(work, tasks, 1))
    monkeypatch.setattr(bank, "RUNS", 1)
    monkeypatch.setattr(drives, "HORIZON_S", 30.0)
    monkeypatch.setattr(making, "Wanted", lambda: few)


def test_the_page_has_all_experiments_and_what_is_done_is_not_done_again(small_bank, tmp_path, monkeypatch):
    study = STUDIES["merging"]
    assert study.suites(None, 1) == {}
    done = list(study.work(tmp_path, None, 1, 1))
    assert ("drives", 9, 9) in done
    assert done[-1] == ("other experiments", 10, 10)
    again = list(study.work(tmp_path, None, 1, 1))
    assert all(what.startswith("pairs") for what, *_ in again)
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
