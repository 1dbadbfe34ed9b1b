"""Where robots were on a floor, and for how long."""

from pathlib import Path

import numpy as np
import pytest

from lidarium.evaluation.analysis.groups import grouped
from lidarium.evaluation.analysis.records import Entry, Track, read_records
from lidarium.evaluation.drawing.floor_pictures import (
    VISIT_CELL_M,
    _ending_of,
    _known_extent,
    _seconds_in_cells,
    _united,
    recorded_pair,
    visits_on,
)


def track_of(levels, poses=None):
    poses = np.zeros((3, 1, 3)) if poses is None else np.asarray(poses, np.float64)
    return Track(np.array([0.0, 1.0, 4.0]), poses, np.asarray(levels, np.uint8), (1.0, -1.0), 0.5)


def test_the_extent_is_what_is_known_or_where_the_robots_were():
    levels = np.full((6, 8), 127)
    levels[2, 3], levels[4, 5] = 0, 255
    assert _known_extent(track_of(levels)) == (2.5, 4.0, 0.0, 1.5)
    poses = [[(1.0, 2.0, 0.0)], [(3.0, 2.5, 0.0)], [(2.0, 5.0, 0.0)]]
    assert _known_extent(track_of(np.full((6, 8), 127), poses)) == (1.0, 3.0, 2.0, 5.0)
    assert _united([(0.0, 1.0, 0.0, 1.0), (2.0, 3.0, -1.0, 0.5)]) == pytest.approx((-0.4, 3.4, -1.4, 1.4))


def test_a_pose_holds_until_the_next_one():
    poses = [[(0.1, 0.1, 0.0)], [(0.1, 0.3, 0.0)], [(9.0, 9.0, 0.0)]]
    seconds = _seconds_in_cells(track_of([[0]], poses), (0.0, 1.0, 0.0, 0.5), (2, 4))
    assert seconds[0, 0] == 1.0
    assert seconds[1, 0] == 3.0
    assert seconds.sum() == 4.0


def test_robots_were_somewhere_all_the_time(episodes_folder, rows):
    records, warnings = read_records(episodes_folder, rows)
    (group,) = grouped(rows)
    visits, tracks = visits_on(group, "apartment", records)
    assert warnings == []
    assert set(visits) == set(tracks) == set(group.runs)
    for each in visits.values():
        assert each.runs == 2
        assert each.seconds.sum() == pytest.approx(2 * 40.0, rel=0.01)
        x_min, x_max, y_min, y_max = each.extent
        sides = (y_max - y_min) / VISIT_CELL_M, (x_max - x_min) / VISIT_CELL_M
        assert each.seconds.shape == pytest.approx(sides)


def test_the_pair_that_most_policies_have_is_shown(row):
    rows = [row("a", 0), row("a", 1), row("b", 1), row("c", 0, floor="clinic")]
    rows = [{**each, "record": f"{k}.npz"} for k, each in enumerate(rows)]
    records = {f"{k}.npz": Entry(Path("x"), np.zeros((0, 2))) for k in range(4)}
    (group,) = grouped(rows)
    pair = recorded_pair(group, "apartment", records)
    assert {policy: each["seed"] for policy, each in pair.items()} == {"a": 1, "b": 1}
    assert recorded_pair(group, "apartment", {}) == {}


def test_an_ending_says_when_all_was_seen_or_how_much(row):
    assert _ending_of(row(t99_s=61.6)) == "99 % in 62 s"
    assert _ending_of(row(coverage_final=0.5, time_s=40.0)) == "50.0 % in 40 s"
