"""Pieces of a long evaluation; nodes of a cluster are in test_on_ray, and the study kills them."""

import json

import pytest
from published_pages import assert_published

from lidarium.benchmarks.studies import machines


def test_pieces_add_to_one_file_that_is_read_again(tmp_path):
    first = machines.run_short(tmp_path, 0, 3, 1)
    second = machines.run_short(tmp_path, 3, 5, 1)
    assert (first["episodes"], second["episodes"]) == (3, 2)
    assert (first["ran"], machines.run_short(tmp_path, 0, 4, 1)["ran"]) == (3, 1)
    assert second["file_bytes"] > first["file_bytes"] > 1000
    again = machines.read_again(tmp_path)
    assert again["episodes"] == 6
    assert again["report_mb"] > 50
    assert again["page_bytes"] > 50_000


def test_what_was_under_way_at_a_kill_is_asked_for_too(tmp_path):
    suite = machines.Suite(policies=("random_walk",), floors=("apartment",), seeds=tuple(range(9)))
    keys = [trial.key for trial in suite.trials()]
    lines = "".join(json.dumps({"key": keys[place]}) + "\n" for place in (0, 4))
    (tmp_path / "episodes.jsonl").write_text(lines)
    assert machines._asked(suite, tmp_path) == set(keys[:5])


def test_the_page_tells_what_breaks_first(tmp_path, monkeypatch):
    figures = {
        "_run_piece": {"episodes": 5000, "ran": 5000, "seconds": 20.0, "memory_mb": 200.0, "file_bytes": 8_000_000},
        "_again": {
            "episodes": 10_000,
            "opened_s": 0.5,
            "report_s": 9.0,
            "report_mb": 400.0,
            "page_bytes": 2e6,
        },
        "_compare": {"gain": 1.9, "episodes": 120, "one_s": 100.0, "two_s": 52.0},
        "_kill": {"killed": 5, "episodes": 77},
    }
    for name, line in figures.items():
        more = {"workers": 2} if name == "_run_piece" else {}
        monkeypatch.setattr(machines, name, lambda *_, line={**line, **more}: line)
    monkeypatch.setattr(machines, "PIECE", 5000)
    done = list(machines.work(tmp_path, None, 10, 2))
    assert done[-1] == ("killed nodes", 1, 1)
    page = machines.page(tmp_path)
    assert_published("machines", page, tmp_path)
    assert "| 10,000 | 4.0 | 200 | 8 |" in page
    assert "so a folder ends at\n   2,680,000 episodes" in page
    assert "| 120 | 4 | 1.90 x (1.90 to 1.90) |" in page
    assert "killed 5 times" in page


@pytest.mark.parametrize("kind", ["VmRSS", "VmHWM"])
def test_memory_is_that_of_this_process(kind):
    assert 50 < machines.memory_mb(kind) < 20_000
