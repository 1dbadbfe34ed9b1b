from published_pages import assert_published

from lidarium.benchmarks.studies import meetings
from lidarium.benchmarks.studies.shared.study import kept_lines


def test_a_part_of_the_study_fills_its_page(tmp_path, monkeypatch):
    monkeypatch.setattr(meetings, "SEEDS", (2000003,))
    monkeypatch.setattr(meetings, "KINDS", ("building",))
    monkeypatch.setattr(meetings, "CHOSEN_ON", ("building:2000003",))
    monkeypatch.setattr(meetings, "HORIZON_S", 60.0)
    monkeypatch.setattr(meetings, "OTHERS", ((2, "range"),))
    done = [what for what, _, _ in meetings.work(tmp_path, None, 1, 1)]
    assert done == ["rules"] * 4 + ["runs"] * 10
    page = meetings.page(tmp_path)
    assert_published("meetings", page, tmp_path)
    assert "over `tour_frontier`, radio `all` | at most 1.03 | 1.000 | 1 | too few floors |" in page
    assert "| `meeting_tours` | 4, one lost | `signal` | 1 | 1 |" in page
    runs = kept_lines(tmp_path / meetings.RUNS_FILE)
    assert any(line["station_s"] is not None for line in runs)
    for line in runs:
        if line["all_know_s"] is not None and line["station"] >= meetings.SHARE:
            assert line["station_s"] <= line["all_know_s"]
        elif line["station_s"] is not None:
            assert line["station_s"] > (line["all_know_s"] or 0.0)


def test_a_quick_part_has_all_kinds_of_floors_radios_teams_and_policies(tmp_path, monkeypatch):
    asked = []
    monkeypatch.setattr(meetings, "do_missing", lambda _path, _what, tasks, *_: asked.extend(tasks) or iter(()))
    assert list(meetings.work(tmp_path, None, meetings.STUDY.quick, 1)) == []
    assert {run.floor.partition(":")[0] for run in asked} == {"office", "building"}
    teams = {(run.robots, run.radio) for run in asked}
    assert teams == {(4, "signal"), (4, "all"), (4, "range"), (4, "line_of_sight"), (2, "signal"), (8, "signal")}
    assert {"meeting_tours", "meeting_frontier", "oblivious", "tethered"} <= {run.policy for run in asked}
    assert any(run.lost for run in asked)
