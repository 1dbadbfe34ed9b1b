"""Ways on dungeon maps stand beside those of other planners, map by map."""

import json

import pytest
from published_pages import assert_published

from lidarium.agents.tours.planning import TourSettings
from lidarium.benchmarks.studies import STUDIES, dungeons

PRINTED = "map,method,way_m,decisions,explored_share\n" + "".join(
    f"{number},{method},{way},9,1.0\n"
    for method, way in (("nearest", 80.0), ("tare", 50.0), ("gt0", 40.0))
    for number in range(3)
)


def episode(policy, name, d99_m, path_m, t99_s=20.0):
    return {
        "key": f"default | maps/{name} | 1 | seed 0 | {policy}",
        "policy": policy,
        "d99_m": d99_m,
        "path_m": [path_m],
        "t99_s": t99_s,
    }


@pytest.fixture
def folder(tmp_path):
    # The project's listing is by text: map 1 is 10.png, not 2.png.
    names = ("1.png", "10.png", "100.png", "2.png")
    ways = {"nearest_frontier": (15.0, 20.0), "learned": (10.0, 15.0)}
    lines = [episode(policy, name, *way) for policy, way in ways.items() for name in names]
    lines[-1] = episode("learned", "2.png", None, 30.0, None)
    (tmp_path / "maps").mkdir()
    text = "".join(json.dumps(line) + "\n" for line in lines)
    (tmp_path / "maps" / "episodes.jsonl").write_text(text)
    (tmp_path / "ways.csv").write_text(PRINTED)
    return tmp_path


def row_of(page, begin, place=0):
    rows = [line for line in page.splitlines() if line.startswith(f"| {begin} |")]
    return [cell.strip() for cell in rows[place].strip("|").split("|")]


def test_maps_are_paired_in_the_order_of_the_projects_listing(folder):
    ways = dungeons.printed_ways(folder / "ways.csv", ["1.png", "10.png", "100.png", "2.png"])
    assert list(ways["tare"]) == ["1.png", "10.png", "100.png"]
    assert dungeons.printed_ways(folder / "ways.csv", ["2.png"]) == {}
    assert dungeons.printed_ways(folder / "missing.csv", ["1.png"]) == {}


def test_ways_are_in_the_projects_metres_and_those_that_missed_count_whole(folder):
    page = dungeons.page(folder)
    assert_published("dungeons", page, folder)
    assert row_of(page, "`learned`")[1:3] == ["20", "30"]
    assert row_of(page, "`learned`")[3].startswith("0.750 (")
    assert row_of(page, "a tour on the known map")[2:4] == ["40", "1"]
    assert row_of(page, "nearest frontier node")[4].startswith("1.600 (")
    assert row_of(page, "`learned`", 1)[1:3] == ["3 of 4", "30"]
    assert row_of(page, "`nearest_frontier`", 1)[3:] == ["1", "1"]


@pytest.mark.parametrize("lost", ["learned", "nearest_frontier"])
def test_a_failed_episode_leaves_its_map_out(folder, lost):
    path = folder / "maps" / "episodes.jsonl"
    kept = [line for line in path.read_text().splitlines(keepends=True) if f"100.png | 1 | seed 0 | {lost}" not in line]
    path.write_text("".join(kept))
    assert len(kept) == 7
    assert "| `learned` | 2 of 3 |" in dungeons.page(folder)
    (folder / "ways.csv").unlink()
    assert "nan" not in dungeons.page(folder)


def test_ways_by_ariadnes_rule_are_set_beside_the_nearest_frontier(folder):
    assert row_of(dungeons.page(folder), "not run")[1] == "-"
    lines = []
    for policy, way in {"nearest_frontier": 20.0, "learned": 15.0}.items():
        for number, name in enumerate(("img_1.png", "img_2.png", "img_3.png")):
            row = episode(policy, name, None, way + number)
            ended = "horizon" if (policy, number) == ("learned", 2) else "stop_rule"
            lines.append({**row, "ended_because": {"robot_0": ended}})
    (folder / "ariadne_test").mkdir()
    (folder / "ariadne_test" / "episodes.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines))
    cells = row_of(dungeons.page(folder), "`learned`", 2)
    assert cells[1:3] == ["2 of 3", "16.0"]
    assert cells[3].startswith("0.761 (")
    assert cells[4:] == ["-", "-", "-"]


def test_without_data_there_is_nothing_to_run():
    assert STUDIES["dungeons"].suites(None, 1) == {}


def test_the_maps_at_hand_are_run_from_their_marks(shared_data, tmp_path):
    suite = dungeons.suites(shared_data, 10)["maps"]
    assert len(suite.floors) == 10
    assert not suite.draws_starts
    for name, count in {"ariadne_test": 100, "ariadne": 12}.items():
        small = dungeons.suites(shared_data, 1)[name]
        assert len(small.floors) == count
        assert small.stop == {"figure": "remaining_cells", "at_most": 250.0}
    assert list(dungeons.work(tmp_path, shared_data, 1, 1)) == [("ways of planners", 1, 1)]
    assert len(dungeons.printed_ways(tmp_path / "ways.csv", [p.name for p in dungeons.maps_of(shared_data)])) == 4


def test_variants_of_tours_stand_beside_both_baselines_by_their_times(folder):
    assert row_of(dungeons.page(folder), "truth")[1:] == ["-", "-", "-"]
    times = {"nearest_frontier": 40.0, "tour_frontier": 20.0, "scaled_sooner": 30.0, "truth": None}
    lines = [
        episode(policy, f"building:{number}", None, 9.0, None if time_s is None else time_s + number)
        for policy, time_s in times.items()
        for number in range(3)
    ]
    (folder / dungeons.BUILDINGS).mkdir()
    (folder / dungeons.BUILDINGS / "episodes.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines))
    page = dungeons.page(folder)
    assert row_of(page, "scaled, sooner")[2].startswith("0.756")
    assert row_of(page, "scaled, sooner")[3].startswith("1.477")
    assert row_of(page, "truth")[3].startswith("85.7"), "runs that miss count whole"
    assert row_of(page, "`tour_frontier`", -1)[3] == "1"
    assert "on 3\ngenerated floors" in page


def test_tours_grow_with_the_range_of_the_laser_alone():
    scaled = dungeons.scaled_tours(2.0 * dungeons.NORMAL_RANGE_M)
    assert (scaled["reach"], scaled["least_gain"], scaled["waiting"]) == (6.0, 1.6, 0.0125)
    same = TourSettings(**dungeons.scaled_tours(dungeons.NORMAL_RANGE_M))
    assert same == TourSettings()
