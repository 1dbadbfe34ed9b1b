"""The study of SLAM: a robot and a log, kept, and the tables."""

import pytest

from lidarium.benchmarks.studies import STUDIES
from lidarium.benchmarks.studies.slam import study as slam


@pytest.fixture
def short(monkeypatch):
    monkeypatch.setattr(slam, "HORIZON_S", 15.0)
    monkeypatch.setattr(slam, "WARMED_BY", "belgioioso")
    monkeypatch.setattr(slam, "RELATIONS", {})
    slam._warm_up.cache_clear()


def test_a_robot_is_followed_without_data_and_not_again(short, tmp_path):
    study = STUDIES["slam"]
    assert list(study.work(tmp_path, None, 1, 1)) == [("robot", 1, 1)]
    assert list(study.work(tmp_path, None, 1, 1)) == []
    page = study.page(tmp_path, "lidarium reproduce slam")
    assert "Measured with `lidarium reproduce slam` on " in page
    assert "explores `apartment` over " in page
    assert "| scan matched, local maps and map updated | " in page


def test_every_so_many_th_log_is_followed(short, tmp_path, shared_data, monkeypatch):
    monkeypatch.setattr(slam, "OTHERS", ("belgioioso", "acapulco"))
    study = STUDIES["slam"]
    assert list(study.work(tmp_path, shared_data, 2, 1)) == [("logs", 1, 1), ("robot", 1, 1)]
    assert list(study.work(tmp_path, shared_data, 2, 1)) == []
    page = study.page(tmp_path, "lidarium reproduce slam --data data --every 2")
    assert "| belgioioso | 395 | " in page
    assert "| acapulco |" not in page
