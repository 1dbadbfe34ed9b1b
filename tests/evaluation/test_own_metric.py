"""A metric of a user's own, registered in one place, is in results, tables, the page and the reference."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from lidarium.evaluation.metrics import METRICS, metric, metrics_table
from lidarium.evaluation.report import write_report
from lidarium.registry import registry
from tests.evaluation.conftest import write_directory

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "metrics.md"


@pytest.fixture
def turned():
    @metric("turned_rad", unit="rad", direction="lower", summary="Angle that the robots turned.", digits=3)
    def turned_rad(episode):
        return np.abs(np.diff(np.unwrap(episode.poses[..., 2], axis=0), axis=0)).sum()

    yield turned_rad
    registry("metric").unregister("turned_rad")


@pytest.fixture
def reported(turned, tmp_path):
    """Return rows, report.json, report.md and the data of the page of a few episodes with the metric."""
    folder = write_directory(tmp_path, ("nearest_frontier", "random_walk"), horizon_s=10.0)
    rows = [json.loads(line) for line in (folder / "episodes.jsonl").read_text().splitlines()]
    numbers = write_report(folder, folder / "report", replays=0)
    page = (folder / "report" / "report.html").read_text(encoding="utf-8")
    data = re.search(r'id="page-data">(.*?)</script>', page, re.DOTALL)[1]
    return rows, numbers, (folder / "report" / "report.md").read_text(encoding="utf-8"), json.loads(data)


def test_a_metric_is_in_results_tables_and_page(reported):
    rows, numbers, markdown, page = reported
    turned = [row["turned_rad"] for row in rows]
    assert all(isinstance(value, float) and value > 0.0 for value in turned)
    # Built-in metrics keep their place.
    assert list(rows[0])[-6:] == [
        "steps_per_s",
        "turned_rad",
        "version",
        "floor_sha256",
        "settings_sha256",
        "record",
    ]
    (group,) = numbers["groups"]
    assert group["values"]["random_walk"]["turned_rad"]["median"]["estimate"] == pytest.approx(np.median(turned[2:]))
    assert "turned rad [rad], median" in markdown
    assert page["values"]["turned_rad"] == {
        "title": "turned rad",
        "unit": "rad",
        "digits": 3,
        "direction": "lower",
        "summary": "Angle that the robots turned.",
        "by_mean": False,
        "is_main": True,
    }
    assert page["episodes"]["turned_rad"] == [round(value, 3) for value in turned]


def test_a_metric_that_some_episodes_lack_is_no_column(reported, tmp_path):
    path = tmp_path / "episodes.jsonl"
    first, *others = path.read_text().splitlines()
    row = json.loads(first)
    del row["turned_rad"]
    path.write_text("\n".join([json.dumps(row), *others]) + "\n")
    numbers = write_report(tmp_path, tmp_path / "again", replays=0)
    (group,) = numbers["groups"]
    assert "turned_rad" not in group["values"]["random_walk"]
    assert "turned_rad" in group["further_medians"]["random_walk"]


def test_a_metric_of_the_package_keeps_its_name_and_a_direction_is_known(turned):
    with pytest.raises(ValueError, match="'path_m' is registered already"):
        metric("path_m", summary="built in")(turned)
    with pytest.raises(ValueError, match="want 'higher', 'lower' or None"):
        metric("other", summary="wrong", direction="up")


def test_the_reference_has_the_table_of_the_registry():
    assert metrics_table() in PAGE.read_text(encoding="utf-8")
    for each in METRICS.values():
        assert each.summary
