"""Detectors side by side: how many of their points all runs find."""

import numpy as np
import pytest
from drawn_maps import apartment

from lidarium.benchmarks.studies.merging.features import compare_detectors, images, stability
from lidarium.benchmarks.studies.merging.tables import detectors


def test_points_that_not_all_runs_find_count_against_a_detector():
    runs = iter([[(0, 0), (1, 1)], [(0, 0)], [(0, 0), (2, 2)]])
    assert stability(lambda _: np.array(next(runs)), apartment(), 3) == pytest.approx(1.0 / 3.0)
    assert stability(lambda _: np.zeros((0, 2)), apartment(), 2) == 1.0


def test_all_detectors_find_the_same_points_in_all_runs(monkeypatch):
    monkeypatch.setattr("lidarium.benchmarks.studies.merging.features.REPEATS", 1)
    rows = compare_detectors({})
    assert [row["image"] for row in rows] == list(images({}))
    for row in rows:
        assert set(row["stable"]) == set(row["points"])
        assert set(row["stable"].values()) == {1.0}
    assert "a detector finds in all of 20 runs is 100 %" in detectors(rows)
    rows[0]["stable"]["ours"] = 0.5
    assert "is 50 %" in detectors(rows)
    # Results of before, without stability, have a page as well.
    assert "finds in all" not in detectors([{k: v for k, v in row.items() if k != "stable"} for row in rows])
