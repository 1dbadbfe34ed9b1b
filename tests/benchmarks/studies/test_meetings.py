from published_pages import assert_published

from lidarium.benchmarks.studies import meetings


def test_a_part_of_the_study_fills_its_page(tmp_path, monkeypatch):
    monkeypatch.setattr(meetings, "FLOORS", ("building:2000003",))
    monkeypatch.setattr(meetings, "CHOSEN_ON", ("building:2000003",))
    monkeypatch.setattr(meetings, "HORIZON_S", 60.0)
    monkeypatch.setattr(meetings, "OTHERS", ((2, "range"),))
    done = [what for what, _, _ in meetings.work(tmp_path, None, 1, 1)]
    assert done == ["rules"] * 4 + ["runs"] * 10
    page = meetings.page(tmp_path)
    assert_published("meetings", page, tmp_path)
    assert "over `tour_frontier`, radio `all` | at most 1.03 | 1.000 | 1 | too few floors |" in page
    assert "| `meeting_tours` | 4, one lost | `signal` | 1 | 1 |" in page
