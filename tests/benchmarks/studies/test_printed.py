"""The page of printed tables pairs policies by floor and start, and shows published figures."""

import json

import pytest
from published_pages import assert_published

from lidarium.benchmarks.studies import STUDIES, printed


def keep(folder, preset, ways):
    """Write an episode of each policy on each floor; ``ways`` gives their path lengths."""
    (folder / preset).mkdir()
    lines = [
        {
            "key": f"{preset} | {floor} | 1 | seed 0 | {policy}",
            "policy": policy,
            "floor": str(floor),
            "starts": [[0.0, 0.0, 0.0]],
            "path_m": [way],
            "decisions": 129 if floor < 2 else 50,  # one call more carries out the stop
            "success": floor != 0,
            "c_valid_final": 0.5,
            "auc": way / 1000.0,
        }
        for policy in printed.POLICIES[preset]
        for floor, way in enumerate(ways(policy))
    ]
    (folder / preset / "episodes.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines))


@pytest.fixture
def folder(tmp_path):
    for preset in printed.POLICIES:
        keep(tmp_path, preset, lambda policy: [90.0, 180.0] * 4 if policy == "learned" else [100.0, 200.0] * 4)
    return tmp_path


def row_of(page, heading, begin):
    lines = page.partition(f"## {heading}")[2].splitlines()
    return [cell.strip() for cell in next(line for line in lines if line.startswith(begin)).strip("|").split("|")]


def test_ratios_are_those_of_pairs(folder):
    page = printed.page(folder)
    assert_published("printed", page, folder)
    assert row_of(page, "DARE", "| `nearest_node`") == ["`nearest_node`", "150 +- 50", "1"]
    assert row_of(page, "DARE", "| `learned`")[1:] == ["135 +- 45", "0.900 (no interval)"]  # all pairs are alike
    assert row_of(page, "DARE", "| TARE local")[1:] == ["558 +- 67", "0.856"]
    assert row_of(page, "ARiADNE", "| `learned`")[1:] == ["0.900 (no interval)"] * 3
    assert row_of(page, "ARiADNE", "| easy | `learned`")[2:] == ["7 of 8", "135.0", "0.900 (no interval)"]
    assert row_of(page, "MapEx", "| `learned`")[1:] == ["0.500", "0.135", "0.900 (no interval)"]


def test_starts_on_one_floor_are_not_independent(folder):
    def lines(share):
        return [
            {"policy": policy, "floor": f"f{k // 4}", "starts": [[float(k)]], "key": f"{policy} {k}", **figures}
            for policy, factor in (("nearest_frontier", 1.0), ("learned", share))
            for k in range(24)
            for figures in [{"auc": (1.0 if factor == 1.0 else factor + 0.05 * (k // 4)), "c_valid_final": 0.5}]
        ]

    (folder / "mapex" / "episodes.jsonl").write_text("".join(json.dumps(each) + "\n" for each in lines(0.8)))
    ours = printed.by_policy("mapex", folder / "mapex" / "episodes.jsonl")
    assert len(ours["learned"]) == 24
    assert printed._over(ours, "learned", printed._area) == "0.921 (0.828 to 1.025)"  # Student, six floors


def test_floors_that_a_policy_lacks_count_for_none(folder):
    path = folder / "dare" / "episodes.jsonl"
    path.write_text("".join(path.read_text().splitlines(keepends=True)[:-1]))
    assert row_of(printed.page(folder), "DARE", "| `nearest_node`")[1] == "143 +- 49"


def test_without_data_nothing_runs_and_the_page_says_so(tmp_path):
    assert STUDIES["printed"].suites(None, 1) == {}
    assert printed.page(tmp_path).count("| not run |") == 4


def test_a_part_keeps_the_starts_of_its_floors(shared_data):
    suites = STUDIES["printed"].suites(shared_data, 10)
    ariadne = dict.fromkeys(printed.ARIADNE, 10)
    assert {name: len(suite.floors) for name, suite in suites.items()} == {"dare": 10, **ariadne, "mapex": 3}
    assert sum(map(len, suites["mapex"].starts.values())) == 3  # every tenth of 22
    assert list(suites["mapex"].starts) == list(suites["mapex"].floors)
    assert all(trial.start >= 0 for trial in suites["dare"].trials())
