import json
import shutil

import cv2
import numpy as np
import pytest

from lidarium.evaluation.report import write_report
from lidarium.evaluation.report.report import jsonable
from lidarium.evaluation.statistics import Interval


def pictures_in(page):
    return [line.split("(")[1].rstrip(")") for line in page.splitlines() if line.startswith("![")]


def test_a_report_has_tables_plots_and_all_their_numbers(episodes_folder, tmp_path):
    result = write_report(episodes_folder, tmp_path / "out")
    page = (tmp_path / "out" / "report.md").read_text()
    assert json.loads((tmp_path / "out" / "report.json").read_text()) == result
    assert result["baseline"] == "nearest_frontier"
    assert (result["episodes"], result["records"]) == (6, 6)
    (group,) = result["groups"]
    assert group["pictures"] == pictures_in(page)
    assert [name.split("_")[0] for name in group["pictures"]] == [
        "coverage",
        "boxes",
        "profiles",
        "paths",
        "visits",
    ]
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == sorted(
        [*group["pictures"], "marl_eval.json", "report.html", "report.json", "report.md", "table.tex"]
    )
    for name in group["pictures"]:
        picture = cv2.imread(str(tmp_path / "out" / name))
        assert min(picture.shape[:2]) > 300
        assert (picture != 255).any()
    for heading in (
        "Time to 90 %",
        "Time to 99 %",
        "Coverage, paths, overlap",
        "Compared with `nearest_frontier`",
        "By floor",
    ):
        assert f"### {heading}" in page
    visits = group["visits"]["apartment"]["random_walk"]
    # Two robots for the whole of each run.
    assert np.sum(visits["seconds"]) == pytest.approx(2 * 40.0, rel=0.01)
    curve = group["coverage_over_time"]["random_walk"]
    assert curve["runs"] == 2
    assert all(
        later >= sooner for sooner, later in zip(curve["median_percent"], curve["median_percent"][1:], strict=False)
    )
    assert {each["policy"] for each in group["comparisons"]} == {"random_walk", "utility_frontier"}
    assert any("fewer than 50 independent runs" in warning for warning in result["warnings"])
    assert any("fewer than 50 pairs" in warning for warning in result["warnings"])
    assert any("repeat another one" in warning for warning in result["warnings"])


def test_pictures_of_different_settings_have_different_names(episodes_folder, tmp_path):
    folder = tmp_path / "episodes"
    shutil.copytree(episodes_folder, folder)
    rows = [json.loads(line) for line in (folder / "episodes.jsonl").read_text().splitlines()]
    lines = [json.dumps({**row, "variant": variant}) for variant in ("noise 1", "noise-1") for row in rows]
    (folder / "episodes.jsonl").write_text("\n".join(lines) + "\n")
    first, second = write_report(folder, tmp_path / "out")["groups"]
    assert [first["title"], second["title"]] == ["noise 1: 2 robots, drawn floors", "noise-1: 2 robots, drawn floors"]
    assert any(name.startswith("visits") for name in first["pictures"])
    assert set(first["pictures"]).isdisjoint(second["pictures"])


def test_without_records_their_plots_are_left_out_and_that_is_told(rows, directory_of, tmp_path):
    result = write_report(directory_of(rows), tmp_path / "out", baseline="random_walk")
    assert [name.split("_")[0] for name in result["groups"][0]["pictures"]] == ["boxes", "profiles"]
    assert (
        "There are no records in records/, so coverage over time, paths and visits are not drawn." in result["warnings"]
    )
    assert "Compared with `random_walk`" in (tmp_path / "out" / "report.md").read_text()


def test_a_damaged_record_is_left_out_and_named(rows, directory_of, tmp_path, episodes_folder):
    folder = directory_of(
        [rows[0], {**rows[1], "record": "records/cut.npz"}, {**rows[2], "record": "records/other.npz"}]
    )
    (folder / "records").mkdir()
    for name in (rows[0]["record"], "records/other.npz"):
        (folder / name).write_bytes((episodes_folder / rows[0]["record"]).read_bytes())
    (folder / "records" / "cut.npz").write_bytes(b"PK")
    result = write_report(folder, tmp_path / "out")
    assert result["records"] == 1
    assert any(warning.startswith("The record cut.npz was left out") for warning in result["warnings"])
    assert any("left out: it is of an episode with another policy" in warning for warning in result["warnings"])
    assert any("2 of 3 episodes have no record" in warning for warning in result["warnings"])


def test_the_same_directory_gives_the_same_report(rows, directory_of, tmp_path):
    folder = directory_of(rows)
    first, second = (write_report(folder, tmp_path / name, seed=3) for name in ("first", "second"))
    assert first == second
    for name in ("report.md", "report.json", first["groups"][0]["pictures"][0]):
        assert (tmp_path / "first" / name).read_bytes() == (tmp_path / "second" / name).read_bytes()


def test_runs_without_a_partner_are_told(rows, directory_of, tmp_path):
    result = write_report(directory_of(rows[:-1]), tmp_path / "out")
    assert any("1 of `utility_frontier` or `nearest_frontier`" in warning for warning in result["warnings"])


def test_a_policy_that_is_gone_is_reported_all_the_same(rows, directory_of, tmp_path):
    result = write_report(directory_of([{**rows[0], "policy": "gone"}]), tmp_path / "out")
    assert result["baseline"] == "gone"
    assert any("does not have: gone" in warning for warning in result["warnings"])


def test_a_baseline_without_episodes_is_refused_and_nothing_written(rows, directory_of, tmp_path):
    with pytest.raises(
        ValueError,
        match=("--baseline is 'best', of which there are no episodes; want one of nearest_frontier, random_walk"),
    ):
        write_report(directory_of(rows), tmp_path / "out", baseline="best")
    assert not (tmp_path / "out").exists()


def test_what_is_not_finite_becomes_null():
    assert jsonable({"a": Interval(1.0, -np.inf, np.inf, 0.95, 3), "b": np.array([np.nan, 2.0])}) == {
        "a": {"estimate": 1.0, "low": None, "high": None, "confidence": 0.95, "size": 3},
        "b": [None, 2.0],
    }
