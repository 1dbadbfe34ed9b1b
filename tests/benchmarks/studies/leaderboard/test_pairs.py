import pytest

from lidarium.benchmarks.studies.leaderboard.pairs import merges_text, pairs_table


def episode(policy, floor, t99_s, accepted=0, wrong=0):
    merges = {"accepted": accepted, "wrong": wrong}
    key = f"default | {floor} | 2 | seed 0 | {policy}"
    return {"key": key, "policy": policy, "robots": 2, "t99_s": t99_s, "merges": merges}


@pytest.fixture
def episodes():
    slow = [episode("supervised", f"f{k}", 100.0, accepted=2) for k in range(6)]
    fast = [episode("supervised_learned", f"f{k}", 80.0 + k, wrong=k == 3) for k in range(6)]
    lost = [episode("independent", f"f{k}", None) for k in range(6)]
    return {"unknown": [*slow, *fast, *lost], "ideal": [episode("learned", "f0", 9.0)]}


def test_pairs_of_floors_are_compared_and_lone_ones_left_out(episodes):
    rows = pairs_table(episodes, {"unknown": "far"}).splitlines()[2:]
    cells = [[cell.strip() for cell in row.strip("|").split("|")] for row in rows]
    assert [row[:4] for row in cells] == [
        ["far", "`supervised`", "`independent`", "6"],
        ["far", "`supervised_learned`", "`supervised`", "6"],
    ]
    assert cells[1][4] == cells[1][6] == "-"
    assert cells[1][5].startswith("0.825 (")
    assert cells[1][7] == cells[1][5]
    assert cells[0][5].startswith("0.056 (")  # 100 s of the whole 1,800 s


def test_joins_in_wrong_places_are_told(episodes):
    assert merges_text([]) == ""
    assert merges_text(episodes["unknown"]).endswith("joined maps 12 times, 1 of them in a wrong place.")
