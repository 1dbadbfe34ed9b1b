"""The study of spline maps: a short drive is measured, kept, and stands in the table."""

import json
import math
from functools import partial

import numpy as np
import pytest
from published_pages import assert_published

from lidarium.benchmarks.studies import STUDIES
from lidarium.benchmarks.studies.splines import buildings
from lidarium.benchmarks.studies.splines import study as splines
from lidarium.envs.settings.making import make_settings


@pytest.fixture
def tiny(monkeypatch):
    monkeypatch.setattr(splines, "make_settings", partial(make_settings, horizon_s=6.0))
    monkeypatch.setattr(splines, "SEEDS", range(100, 101))
    monkeypatch.setattr(buildings, "HORIZON_S", 6.0)
    monkeypatch.setattr(buildings, "FLOORS", ("apartment",))


def test_a_tiny_share_runs_and_is_not_run_again(tiny, tmp_path):
    study = STUDIES["splines"]
    assert list(study.work(tmp_path, None, 100, 1)) == [("floors", 1, 1), ("buildings", 1, 1)]
    assert list(study.work(tmp_path, None, 100, 1)) == []
    page = study.page(tmp_path)
    assert_published("splines", page, tmp_path)
    for name in splines.LOCALIZERS:
        assert f"| srt_corridor | `{name}` | " in page
    assert "| apartment | `splines` | " in page
    for name in splines.LOCALIZERS:
        assert (tmp_path / splines.PICTURES_FOLDER / f"srt_corridor_{name}.png").exists()


def test_distances_are_counted_in_standard_deviations_round_the_circle():
    true = np.array([[0.0, 0.0, math.pi - 0.01], [1.0, 2.0, 0.0]])
    believed = np.array([[0.0, 0.0, -math.pi + 0.01], [1.2, 2.0, 0.0]])
    covariances = np.stack([np.eye(3) * 1e-4, np.diag([0.01, 1.0, 1.0])])
    found = buildings.squared_distances(true, believed, covariances)
    np.testing.assert_allclose(found, [4.0, 4.0], rtol=1e-6)


def test_figures_that_are_no_numbers_are_kept():
    figures = splines.MapFigures(
        0.1, 0.1, 1.0, 0.3, math.nan, math.nan, 0.5, 1.0, 0, 0, size_bytes=8, of_end_points=0.1, of_grid=0.1
    )
    kept = json.loads(json.dumps(splines._as_entry(splines.Run(figures, 1.0, 2.0)), allow_nan=False))
    run = splines._run_of(kept)
    assert math.isnan(run.figures.wall_mean_m)
    assert run.figures.size_bytes == 8


def test_odometry_is_too_long_by_its_bias_and_repeats_with_its_seed():
    poses = np.stack([np.linspace(0.0, 10.0, 101), np.zeros(101), np.zeros(101)], axis=1)
    reckoned = splines.odometry(poses, 3)
    assert reckoned[-1, 0] == pytest.approx(10.5, abs=0.1)
    assert np.array_equal(reckoned, splines.odometry(poses, 3))
