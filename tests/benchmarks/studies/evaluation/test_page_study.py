import json

import pytest

from lidarium.benchmarks.studies import STUDIES
from lidarium.benchmarks.studies.evaluation import page_folder, page_study
from lidarium.benchmarks.studies.shared.kept import kept_lines
from lidarium.evaluation.report import read_episodes
from lidarium.evaluation.suites.episodes_file import KEY


@pytest.fixture
def short_episodes(monkeypatch):
    monkeypatch.setattr(page_folder, "FLOOR", "apartment")
    monkeypatch.setattr(page_folder, "DURATION_S", 8.0)


def test_the_folder_is_one_that_a_report_reads(short_episodes, tmp_path):
    page_folder.write_folder(tmp_path, 40, 4)
    rows = read_episodes(tmp_path).rows
    assert len(rows) == 40
    assert {row["robots"] for row in rows} == {3, 1}
    recorded = [row for row in rows if row["record"]]
    assert len(recorded) == 4
    assert all((tmp_path / row["record"]).is_file() for row in recorded)
    assert len({json.dumps(row["path_m"]) for row in rows}) > 30


def test_the_study_measures_a_small_page_and_reports_it(short_episodes, tmp_path, monkeypatch):
    browser = page_study.headless_chromium
    try:
        browser().quit()
    except ValueError as error:
        pytest.skip(str(error))
    monkeypatch.setattr(page_study, "ROUNDS", 1)
    monkeypatch.setattr(page_folder, "EPISODES", 60)
    monkeypatch.setattr(page_folder, "REPLAYS", 2)
    study = STUDIES["page"]
    assert study.work is not None
    assert [done for _, done, _ in study.work(tmp_path, None, 1, 1)] == [1, 2]
    replay, report = kept_lines(tmp_path / page_study.FILE)
    assert replay[KEY].startswith("replay")
    assert replay["replay_bytes"] < replay["page_bytes"] < report["page_bytes"]
    assert replay["frames_per_s"] > 0.0
    assert 0.0 < report["sort_median_ms"] <= report["sort_ms"]
    text = study.page(tmp_path, "lidarium reproduce page")
    assert "60 episodes with 2 replays" in text
    assert text.count("reached") >= 6


def test_what_is_not_reached_is_told():
    assert page_study._line("size [MB]", 2.0, "<=", 1.0) == "| size [MB] | 2.00 | <= 1 | **not reached** |"
    assert page_study._line("frames", 30.0, ">=", 30.0) == "| frames | 30.0 | >= 30 | reached |"


def test_a_browser_that_is_not_there_is_named_with_the_cure(monkeypatch):
    pytest.importorskip("selenium")
    monkeypatch.setattr("shutil.which", lambda name: None)
    with pytest.raises(ValueError, match="apt-get install chromium chromium-driver"):
        page_study.headless_chromium()
