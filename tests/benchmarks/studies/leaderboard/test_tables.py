from lidarium.benchmarks.studies.leaderboard.tables import Part, short_table, table
from lidarium.benchmarks.studies.leaderboard.worlds import WORLDS


def times(seconds, share=1.0):
    return {
        "size": 50,
        "success": {"estimate": share},
        "median": {"estimate": seconds, "low": seconds and seconds - 5.0, "high": seconds and seconds + 5.0},
        "restricted_mean": {"estimate": 900.0 if seconds is None else seconds},
    }


def group(robots, **seconds):
    values = {name: {"median": {"estimate": 12.4}} for name in ("path_m", "overlap_percent")}
    difference = {"estimate": -40.0, "low": -50.0, "high": -30.0}
    comparison = {"policy": "learned", "key": "t99_s", "difference": difference, "is_beyond_chance": True}
    return {
        "robots": robots,
        "times": {"t99_s": {name: times(value) for name, value in seconds.items()}},
        "values": dict.fromkeys(seconds, values),
        "comparisons": [comparison],
    }


def cells(line):
    return [cell.strip() for cell in line.strip("|").split("|")]


PARTS = [
    Part(
        WORLDS["ideal"],
        [group(n, nearest_frontier=100.0, random_walk=None, learned=60.0) for n in (1, 2)],
        {("learned", 2): 1.514},
    ),
    Part(WORLDS["lab"], [group(2, nearest_frontier=110.0)], {}),
]


def test_rows_stand_by_team_then_world_the_best_first():
    lines = [cells(line) for line in table(PARTS).splitlines()[2:]]
    assert [line[:3] for line in lines] == [
        ["1", "ideal", "`learned`"],
        ["1", "ideal", "`nearest_frontier`"],
        ["1", "ideal", "`random_walk`"],
        ["2", "ideal", "`learned`"],
        ["2", "ideal", "`nearest_frontier`"],
        ["2", "ideal", "`random_walk`"],
        ["2", "lab", "`nearest_frontier`"],
    ]
    learned = ["50", "100 %", "60 (55 to 65)", "1.51", "**-40 (-50 to -30)**", "12", "12"]
    assert lines[3][3:] == learned
    assert lines[0][6] == lines[6][6] == "-"
    assert lines[2][5] == "never (no interval)"


def test_the_short_table_shows_one_team_of_the_ideal_world():
    lines = short_table(PARTS, 2).splitlines()
    assert cells(lines[2]) == ["`learned`", "100 %", "60 (55 to 65)", "1.51", "**-40 (-50 to -30)**"]
    assert len(lines) == 5
