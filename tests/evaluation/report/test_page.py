"""The page of a report."""

import json

import numpy as np
import pytest
from page_reader import Scripts, outside_of, page_data, replay_of_page

from lidarium.evaluation.analysis.groups import grouped
from lidarium.evaluation.analysis.records import Entry
from lidarium.evaluation.report import write_report
from lidarium.evaluation.report.page import FRONT_END, chosen_replays, rounded, write_page, write_replay_page
from lidarium.evaluation.report.replay_page import Replay

EVIL = '</script><img src=x onerror=alert(1)>"&amp; `a|b` \\*'


@pytest.fixture(scope="module")
def report_folder(episodes_folder, tmp_path_factory):
    out = tmp_path_factory.mktemp("report")
    return out, write_report(episodes_folder, out, replays=4)


def test_the_page_has_all_episodes_and_the_figures_of_the_report(report_folder, rows):
    out, result = report_folder
    data = page_data(out / "report.html")
    episodes = data["episodes"]
    assert len(episodes["group"]) == len(rows) == result["episodes"]
    policies = list(data["policies"])
    shown = {
        (policies[policy], seed): (coverage, t90)
        for policy, seed, coverage, t90 in zip(
            episodes["policy"], episodes["seed"], episodes["coverage_percent"], episodes["t90_s"], strict=True
        )
    }
    for row in rows:
        coverage, t90 = shown[row["policy"], row["seed"]]
        assert coverage == pytest.approx(100.0 * row["coverage_final"], abs=0.051)
        assert t90 == (None if row["t90_s"] is None else pytest.approx(row["t90_s"], abs=0.01))
    (group,), (told,) = data["groups"], result["groups"]
    for key in ("times", "values", "comparisons", "coverage_over_time", "profiles", "by_floor"):
        assert group[key] == rounded(told[key])
    assert (group["robots"], group["floors"], group["settings"]) == (2, ["apartment"], rows[0]["realism"])


def test_multiples_of_the_bound_are_on_the_page_where_there_are_any(rows, tmp_path):
    bounded = [{**row, "bound_s": 2.0 * row["horizon_s"], "t99_s": row["horizon_s"]} for row in rows[:1]] + rows[1:]
    text = "".join(json.dumps(row) + "\n" for row in bounded)
    (tmp_path / "episodes.jsonl").write_text(text)
    write_report(tmp_path, tmp_path / "report")
    (group,) = page_data(tmp_path / "report" / "report.html")["groups"]
    policy = rows[0]["policy"]
    assert {name for name, found in group["over_bound"].items() if found is not None} == {policy}
    assert group["over_bound"][policy]["ratio"]["estimate"] == 0.5


def test_replays_are_those_of_the_episodes_that_name_them(report_folder):
    out, result = report_folder
    data = page_data(out / "report.html")
    assert len(data["replays"]) == result["replays"] == 4
    episodes = data["episodes"]
    for place, policy, seed in zip(episodes["replay"], episodes["policy"], episodes["seed"], strict=True):
        if place >= 0:
            header, _ = replay_of_page(out / "report.html", place)
            assert (header["policy"], header["seed"]) == (list(data["policies"])[policy], seed)
            assert header["lacks"] == ""
    assert sorted(place for place in episodes["replay"] if place >= 0) == [0, 1, 2, 3]


def test_the_page_fetches_nothing(report_folder):
    text = (report_folder[0] / "report.html").read_text(encoding="utf-8")
    assert outside_of(text) == []
    assert "default-src 'none'" in text


def test_names_cannot_end_the_script_that_they_stand_in(rows, directory_of, tmp_path):
    folder = directory_of([{**row, "policy": EVIL, "floor": EVIL, "variant": EVIL} for row in rows[:2]])
    write_report(folder, tmp_path / "out")
    scripts = Scripts((tmp_path / "out" / "report.html").read_text(encoding="utf-8"))
    assert "img" not in scripts.tags
    data = json.loads(scripts.found["page-data"])
    assert list(data["policies"]) == [EVIL]
    assert data["episodes"]["floors"] == [EVIL]
    assert any(EVIL in warning for warning in data["warnings"])


def recorded_rows(floors, seeds, policies):
    return [
        {
            "floor": floor,
            "floor_sha256": floor,
            "policy": policy,
            "robots": 2,
            "seed": seed,
            "horizon_s": 10.0,
            "time_s": 10.0,
            "record": f"{floor} {seed} {policy}",
        }
        for floor in floors
        for seed in seeds
        for policy in policies
    ]


def test_replays_are_of_all_policies_on_one_floor_then_of_the_next_floor():
    rows = recorded_rows(["apartment", "office:1", "office:2"], [0, 1], ["a", "b"])
    records = {row["record"]: Entry(None, np.zeros((0, 2))) for row in rows if row["record"] != "office:1 0 b"}
    chosen = [row["record"] for row in chosen_replays(grouped(rows), records, 7)]
    assert chosen == [
        "apartment 0 a",
        "apartment 0 b",
        "office:1 0 a",
        "apartment 1 a",
        "apartment 1 b",
        "office:2 0 a",
        "office:2 0 b",
    ]


def test_a_negative_number_of_replays_is_refused_and_nothing_written(rows, directory_of, tmp_path):
    with pytest.raises(ValueError, match=r"--replays is -1; want zero or more"):
        write_report(directory_of(rows), tmp_path / "out", replays=-1)
    assert not (tmp_path / "out").exists()


def test_a_report_without_records_has_a_page_without_replays(rows, directory_of, tmp_path):
    write_report(directory_of(rows), tmp_path / "out")
    data = page_data(tmp_path / "out" / "report.html")
    assert data["replays"] == []
    assert set(data["episodes"]["replay"]) == {-1}


def test_replays_stand_in_the_order_in_which_the_content_names_them(tmp_path):
    path = tmp_path / "page.html"
    replays = [Replay("first", "AAA"), Replay("second", "BBB", lacks="another version")]
    write_page(path, {"kind": "report", "title": "<b>", "number": 1.5}, replays)
    scripts = Scripts(path.read_text(encoding="utf-8"))
    data = json.loads(scripts.found["page-data"])
    assert data["number"] == 1.5
    assert data["replays"] == [
        {"title": "first", "lacks": ""},
        {"title": "second", "lacks": "another version"},
    ]
    assert tuple(scripts.found[f"replay-{place}"].strip() for place in (0, 1)) == ("AAA", "BBB")


def test_a_title_is_text_and_data_cannot_end_their_script(tmp_path):
    path = tmp_path / "page.html"
    evil = "</script><b>\ud800"
    write_replay_page(path, Replay(evil, "AAA"))
    text = path.read_text(encoding="utf-8")
    assert "</script><b>" not in text
    assert "&lt;/script&gt;&lt;b&gt;" in text
    assert text.endswith(FRONT_END.read_text(encoding="utf-8").split("<!--data-->")[1])
    assert json.loads(Scripts(text).found["page-data"])["title"].startswith("</script><b>")


def test_what_is_no_number_leaves_no_page(tmp_path):
    with pytest.raises(ValueError, match="JSON"):
        write_page(tmp_path / "page.html", {"title": "a", "value": float("nan")}, [])
    assert list(tmp_path.iterdir()) == []
