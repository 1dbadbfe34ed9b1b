"""The study of SLAM: a robot and a log, kept, and the tables."""

import gzip
from pathlib import Path

import numpy as np
import pytest
from published_pages import assert_published

from lidarium.benchmarks.studies import STUDIES
from lidarium.benchmarks.studies.slam import lies
from lidarium.benchmarks.studies.slam import study as slam
from lidarium.mapping.geometry.rigid import relative


@pytest.fixture
def short(monkeypatch):
    monkeypatch.setattr(slam, "HORIZON_S", 12.0)
    monkeypatch.setattr(slam, "WARMED_BY", "belgioioso")
    monkeypatch.setattr(slam, "RELATIONS", {})
    slam._warm_up.cache_clear()


def test_a_robot_is_followed_without_data_and_not_again(short, tmp_path):
    study = STUDIES["slam"]
    assert list(study.work(tmp_path, None, 1, 1)) == [("robot", 1, 1)]
    assert list(study.work(tmp_path, None, 1, 1)) == []
    page = study.page(tmp_path)
    assert "explores `apartment` over " in page
    assert "| scan matched, local maps and map updated | " in page


def with_begin_of_aces(shared_data, data, lines=2500):
    """Make a folder of data that has a log as it is, and the first lines of another."""
    whole, kept = shared_data / "laser_logs", data / "laser_logs"
    (kept / "carmen").mkdir(parents=True)
    (kept / "npz").symlink_to(whole / "npz")
    name = Path("carmen") / "aces-corrected.log.gz"
    with gzip.open(whole / name) as log, gzip.open(kept / name, "wb") as begin:
        begin.writelines(log.readlines()[:lines])
    return data


def test_every_so_many_th_log_is_followed(short, tmp_path, shared_data, monkeypatch):
    monkeypatch.setattr(slam, "OTHERS", ("belgioioso", "acapulco"))
    monkeypatch.setattr(lies, "LOGS", ("aces",))
    monkeypatch.setattr(lies, "TURNS", 1)
    study, data = STUDIES["slam"], with_begin_of_aces(shared_data, tmp_path / "data")
    done = list(study.work(tmp_path, data, 2, 1))
    assert done == [("logs", 1, 1), ("logs that lie", 1, 1), ("robot", 1, 1)]
    assert list(study.work(tmp_path, data, 2, 1)) == []
    page = study.page(tmp_path)
    assert_published("slam", page, tmp_path)
    assert "| belgioioso | 395 | " in page
    assert "| acapulco |" not in page
    assert "| aces | every tenth ODOM line removed | " in page


def test_a_lie_is_honest_where_the_error_stays_small_or_it_is_named():
    line = {"ate_m": 0.3, "whole_m": 0.2, "is_named": False}
    assert lies.is_honest(line)
    assert not lies.is_honest(line | {"ate_m": 0.31})
    assert lies.is_honest(line | {"ate_m": 9.0, "is_named": True})


def test_a_hidden_turn_is_out_of_the_scans_and_of_odometry(shared_data):
    whole = lies._read(shared_data / "laser_logs" / "carmen" / "aces-corrected.log.gz")
    log, at_s = lies._with_hidden_turn(whole, 0)
    missing = len(whole.stamps) - len(log.stamps)
    assert 0 <= missing < lies.MOST_SCANS
    [gap] = np.flatnonzero(np.isin(whole.stamps, [at_s]))
    place = int(np.flatnonzero(log.stamps == at_s)[0])
    assert np.array_equal(log.odometry[place], log.odometry[place - 1])
    turn = abs(np.degrees(relative(whole.corrected[gap - missing - 1], whole.corrected[gap])[2]))
    assert 45.0 < turn < 105.0
