"""The leaderboard's page, the page for browsers and the README's table, from a small evaluation."""

import json

import pytest
from published_pages import assert_published

from lidarium.benchmarks.studies.leaderboard import study, worlds
from lidarium.evaluation.suites.campaign import Campaign
from lidarium.evaluation.suites.suite import Suite

README = f"# Title\n\nbefore\n\n{study.BEGIN}\n\nold\n\n{study.END}\n\nafter\n"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A few policies on an apartment, with bounds."""
    folder = tmp_path_factory.mktemp("runs")
    settings = {"resolution": 0.1, "horizon_s": 40.0, "lidar": {"beams": 90}}
    suite = Suite(
        policies=("nearest_frontier", "random_walk", "explore_lite", "tour_frontier"),
        floors=("apartment",),
        robots=(1, 3),
        variants={"default": settings},
    )
    for _ in Campaign(suite, folder / "test_ideal", 1, False).run():
        pass
    bounds = [{"key": f"apartment | {n}", "floor": "apartment", "robots": n, "known_s": 9.0} for n in (1, 3)]
    (folder / "bounds.jsonl").write_text("".join(json.dumps(line) + "\n" for line in bounds))
    (folder / "bounds_asked.json").write_text(json.dumps({"keys": [line["key"] for line in bounds]}))
    return folder


def test_the_page_has_a_table_of_what_ran_and_names_what_did_not(folder, tmp_path):
    page = study.page(folder)
    assert_published("leaderboard", page, tmp_path, ("LIFULL", "KTH", "Dungeons", "Maps that"))
    assert "## Generated floors of the set `test` (1)" in page
    rows = [line.split(" | ") for line in page.splitlines() if line.startswith("| 3 | ideal |")]
    rows = {row[2]: row for row in rows}
    assert set(rows) == {"`nearest_frontier`", "`random_walk`", "`explore_lite`", "`tour_frontier`"}
    assert rows["`random_walk`"][6] == "never"
    assert "| ideal | `tour_frontier` | `explore_lite` | 1 | - | - | - |" in page
    assert "Not in it: LIFULL apartments; KTH campus floors" in page
    assert "generated floors of the set `test` in the world lab;" in page


def test_beside_it_are_the_page_for_browsers_and_the_table_of_the_readme(folder, tmp_path):
    out = tmp_path / "docs" / "results"
    out.mkdir(parents=True)
    (tmp_path / "README.md").write_text(README)
    study.beside(folder, out)
    html = (out / "leaderboard.html").read_text()
    assert "ideal: generated floors of the set" in html
    readme = (tmp_path / "README.md").read_text()
    assert readme.startswith(f"# Title\n\nbefore\n\n{study.BEGIN}\n\n| policy | reached 99 % |")
    assert readme.endswith(f"{study.END}\n\nafter\n")
    assert "old" not in readme
    assert readme.count("`nearest_frontier`") == 1


def test_bounds_are_wanted_of_a_part_of_the_floors(tmp_path, monkeypatch):
    monkeypatch.setattr(study, "measure_bound", _known)
    done = list(study.work(tmp_path, None, 10, 1))
    assert done[-1] == ("bounds", 9, 9)  # three floors of twenty
    assert study._bounds_in(tmp_path)[worlds.floors_of(None, 10)["test"][0], 2] == 20.0


def _known(team):
    return {"floor": team.floor, "robots": team.robots, "known_s": 10.0 * team.robots}
