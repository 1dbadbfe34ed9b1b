"""The page of the fast world pairs episodes of both worlds by floor and size of team."""

import json

import pytest

from lidarium.benchmarks.studies import STUDIES, fast


def keep(folder, seconds):
    """Write an episode of each policy in both worlds; ``seconds`` gives their times by world, policy and floor."""
    (folder / "validation").mkdir()
    lines = [
        {
            "key": f"{world} {policy} {floor} {robots}",
            "variant": world,
            "policy": policy,
            "floor": str(floor),
            "robots": robots,
            "t99_s": seconds(world, policy, floor),
        }
        for world in (fast.FULL, fast.FAST)
        for policy in fast.POLICIES
        for floor in range(8)
        for robots in fast.TEAMS
    ]
    (folder / "validation" / "episodes.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines))


def rows(page, begin):
    return [
        [cell.strip() for cell in line.strip("|").split("|")] for line in page.splitlines() if line.startswith(begin)
    ]


def test_times_are_compared_floor_by_floor_and_the_choice_is_judged_in_the_full_world(tmp_path):
    full = {"nearest_frontier": 130.0, "utility_frontier": 120.0, "tour_frontier": 100.0, "learned": 101.0}

    def seconds(world, policy, floor):
        if (world, policy, floor) == (fast.FAST, "utility_frontier", 0):
            return None
        quicker = 0.9 if policy == "learned" else 1.1
        return (1.0 + floor) * full[policy] * (quicker if world == fast.FAST else 1.0)

    keep(tmp_path, seconds)
    page = fast.page(tmp_path)
    times = {row[1]: row for row in rows(page, "| 2 | `")[: len(fast.POLICIES)]}
    assert times["`tour_frontier`"][2:] == ["8", "450.0", "495.0", "1.100 (no interval)", "8, 8"]
    assert times["`utility_frontier`"][-1] == "8, 7"
    assert rows(page, "| 1 | `learned` | `tour")[0][3:] == ["1.010 (no interval)", "0.826 (no interval)"]
    assert "takes 1.010 of the time" in page


@pytest.mark.parametrize("every", [1, 20])
def test_worlds_differ_in_what_makes_the_fast_one_alone(every):
    suite = STUDIES["fast"].suites(None, every)["validation"]
    assert len(suite.floors) == 60 // every
    assert {name: world.get("realism") for name, world in suite.variants.items()} == {"full": "ideal", "fast": "fast"}
