"""Plots of a group of episodes."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from lidarium.evaluation.analysis.figures import values_of
from lidarium.evaluation.analysis.groups import grouped
from lidarium.evaluation.analysis.records import Entry
from lidarium.evaluation.drawing import plots
from lidarium.evaluation.drawing.plots import (
    CURVE_POINTS,
    _end_of,
    coverage_curves,
    profiles,
    save_boxes,
    save_coverage,
)


def recorded(row, count):
    """Return a group of one policy and its records: run k has covered all by the second 10 (k + 1)."""
    rows = [row("a", seed, record=f"{seed}.npz") for seed in range(count)]
    (group,) = grouped(rows)
    return group, {
        f"{k}.npz": Entry(Path(f"{k}.npz"), np.array([(0.0, 0.0), (10.0 * (k + 1), 1.0)])) for k in range(count)
    }


def test_a_curve_is_the_median_of_the_recorded_runs(row):
    group, records = recorded(row, 3)
    curve = coverage_curves(group, records)["a"]
    assert curve["runs"] == 3
    times, median = np.array(curve["times_s"]), np.array(curve["median_percent"])
    assert (len(times), times[0], times[-1]) == (CURVE_POINTS, 0.0, 100.0)
    assert median.tolist() == [100.0 * (time >= 20.0 - 1e-9) for time in times]
    assert set(curve["low_percent"]) == {None}
    assert coverage_curves(group, {}) == {}


def test_of_enough_runs_a_curve_has_an_interval_around_it(row):
    curve = coverage_curves(*recorded(row, 8))["a"]
    low, median, high = (np.array(curve[f"{name}_percent"]) for name in ("low", "median", "high"))
    assert (low <= median).all()
    assert (median <= high).all()
    assert (low < high).any()


def test_a_plot_ends_once_the_last_curve_has_settled(row):
    curves = coverage_curves(*recorded(row, 3))
    assert _end_of(curves, 100.0) == pytest.approx(1.15 * 20.0)
    assert _end_of(curves, 21.0) == 21.0
    still = {"a": {"times_s": [0.0, 1.0], "median_percent": [5.0, 5.0]}}
    assert _end_of(still, 60.0) == 60.0


def test_plots_are_written(row, tmp_path):
    group, records = recorded(row, 6)
    save_coverage(tmp_path / "coverage.png", group, coverage_curves(group, records))
    save_boxes(tmp_path / "boxes.png", group, values_of(group.runs["a"]))
    for name in ("coverage", "boxes"):
        assert (cv2.imread(str(tmp_path / f"{name}.png")) != 255).any()


def test_boxes_stand_on_zero_without_lines_between_the_policies(row, monkeypatch, tmp_path):
    drawn = []
    monkeypatch.setattr(plots, "save", lambda path, figure, *texts: drawn.append(figure))
    group, _ = recorded(row, 6)
    save_boxes(tmp_path / "boxes.png", group, values_of(group.runs["a"]))
    (figure,) = drawn
    assert [axes.get_title(loc="left") or axes.get_title() for axes in figure.axes]
    for axes in figure.axes:
        assert axes.get_ylim()[0] == 0.0
        assert not any(line.get_visible() for line in axes.get_xgridlines())
        assert any(line.get_visible() for line in axes.get_ygridlines())


@pytest.mark.parametrize("lowest", [0.137, 0.42, 0.9, 0.98])
def test_a_profile_of_coverage_turns_where_episodes_end(row, lowest):
    (group,) = grouped(
        [row(coverage_final=0.99), row(seed=1, coverage_final=0.9903), row(seed=2, coverage_final=lowest)]
    )
    found = profiles(group)["coverage_at_least"]
    share = dict(zip(found["thresholds"], found["share_low_high"]["a"][0], strict=True))
    assert found["thresholds"][0] <= lowest
    assert share[0.99] == pytest.approx(2 / 3)
    assert share[0.995] == 0.0
    assert share[1.0] == 0.0
