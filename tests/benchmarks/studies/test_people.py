from published_pages import assert_published

from lidarium.benchmarks.studies import people


def test_a_part_of_the_study_fills_its_page(tmp_path, monkeypatch):
    monkeypatch.setattr(people, "FLOORS", ("office:6",))
    monkeypatch.setattr(people, "SEEDS", {"nearest_frontier": 1, "random_walk": 1})
    monkeypatch.setattr(people, "POLICIES", ("nearest_frontier", "random_walk"))
    monkeypatch.setattr(people, "EXPLORERS", ("nearest_frontier",))
    monkeypatch.setattr(people, "SLAM_SEEDS", range(1))
    monkeypatch.setattr(people, "HORIZON_S", 30.0)
    monkeypatch.setattr(people, "BATCH", 2)
    monkeypatch.setattr(people, "TIMED", 2)
    done = [what for what, _, _ in people.work(tmp_path, None, 1, 1)]
    assert done == ["batches"] + ["runs with SLAM"] * 2 + ["runs"] * 4
    page = people.page(tmp_path)
    assert_published("people", page, tmp_path)
    assert "| `nearest_frontier` | 1 | 1 |" in page
    assert "| office:6 | 0 |" in page
