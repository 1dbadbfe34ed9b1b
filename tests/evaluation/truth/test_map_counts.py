"""Counts of maps that change are those of whole maps."""

import numpy as np
import pytest
from seen_truth import NEAR, begun, scribbled

from lidarium.evaluation.truth.beliefs import maps_on_floor, shares_one_map
from lidarium.evaluation.truth.map_counts import note_changes
from lidarium.evaluation.truth.map_tally import MapTally
from lidarium.evaluation.truth.true_map import truth_of


def counted_plainly(env, truth):
    maps = maps_on_floor(env)
    known = (maps != 0).any(axis=0)
    team = [int((known & mask).sum()) for mask in (truth.knowable, truth.valid)]
    if shares_one_map(env):
        return [*team, int(((maps.sum(axis=0, dtype=np.int16) < 0) & truth.counted).sum())]
    return [*team, *(int(((own < 0) & truth.counted).sum()) for own in maps)]


def counted(tally):
    team = tally.counts[-1]
    return [*team[:2], team[2]] if tally.shares else [*team[:2], *tally.counts[:-1, 2]]


@pytest.mark.parametrize("known_starts", [True, False])
@pytest.mark.parametrize("robots", [1, 2])
def test_maps_that_contradict_each_other_are_counted_as_whole_maps_are(known_starts, robots):
    env = begun(NEAR[:robots], known_starts=known_starts)
    truth, generator = truth_of(env), np.random.default_rng(5)
    tally = MapTally(env, truth)
    for _ in range(4):
        scribbled(env, generator)
        tally.note_step(env)
        tally.take_in(env)
        assert counted(tally) == counted_plainly(env, truth)


def test_changes_are_noted_as_the_box_around_them():
    changes = np.array([[100, 0, 100, 0], [3, 5, 8, 9]], np.int64)
    note_changes(np.array([[4, 7, 1, 2], [100, 0, 100, 0]], np.int64), changes)
    note_changes(np.array([[6, 9, 0, 1], [4, 6, 7, 8]], np.int64), changes)
    assert changes.tolist() == [[4, 9, 0, 2], [3, 6, 7, 9]]
