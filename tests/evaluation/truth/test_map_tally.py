"""What robots know of a floor, counted step by step."""

import numpy as np
import pytest
from seen_truth import NEAR, begun, scribbled

from lidarium.envs.simulation import maps_on_floor as placed
from lidarium.envs.simulation.coverage import pack_bits
from lidarium.envs.simulation.kernels.arrays import world_at
from lidarium.evaluation.metrics import cells
from lidarium.evaluation.truth import beliefs
from lidarium.evaluation.truth.beliefs import free_as_held, maps_on_floor, shares_one_map
from lidarium.evaluation.truth.map_tally import (
    COUNTED,
    FREE,
    KNOWN,
    CountedMaps,
    MapTally,
    Team,
    cells_beyond,
    note_changes,
    recount_free,
    sum_up,
)
from lidarium.evaluation.truth.true_map import truth_of
from lidarium.mapping.kernels.compilation import kernel


def test_sizes_are_those_of_the_true_masks():
    env = begun()
    truth = truth_of(env)
    assert MapTally(env, truth).sizes.tolist() == [
        truth.knowable.sum(),
        truth.valid.sum(),
        truth.counted.sum(),
    ]


@pytest.mark.parametrize("options", [{}, {"known_starts": False}, {"radio": "range"}])
def test_steps_between_two_counts_are_all_taken_in(options):
    env = begun(**options)
    truth, generator = truth_of(env), np.random.default_rng(3)
    tally = MapTally(env, truth)
    for step in range(30):
        env.step({agent: np.array([1.0, generator.uniform(-1.0, 1.0)], np.float32) for agent in env.agents})
        tally.note_step(env)
        if step % 7 == 6:
            tally.take_in(env)
            maps = maps_on_floor(env)
            held = free_as_held(env, maps) & truth.counted
            found = tally.counts[-1:, 2] if tally.shares else tally.counts[:-1, 2]
            assert set(held.sum(axis=(1, 2)).tolist()) == set(found.tolist())
            assert tally.known_shares == pytest.approx([cells.known_coverage(own != 0, truth.knowable) for own in maps])


def test_what_has_not_been_taken_in_is_not_counted():
    env = begun(NEAR[:1])
    tally = MapTally(env, truth_of(env))
    tally.take_in(env)
    before = tally.counts.copy()
    scribbled(env, np.random.default_rng(0))
    tally.note_step(env)
    assert np.array_equal(tally.counts, before)
    tally.take_in(env)
    assert not np.array_equal(tally.counts, before)


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


ROWS, WORDS = 4, 2


def drawn_maps(generator, robots=2):
    def bits(*shape):
        return generator.integers(0, 2**64, shape, np.uint64, endpoint=False)

    own = bits(robots + 1, ROWS, WORDS, 2)
    own[..., FREE] &= own[..., KNOWN]
    own[-1] = 0
    return CountedMaps(
        bits(3, ROWS, WORDS), own, np.zeros((ROWS, WORDS), np.uint64), np.zeros((robots + 1, 3), np.int64)
    )


def count(bits):
    return int(np.bitwise_count(bits).sum())


@kernel
def recount_all(maps, who, free):
    for i in range(free.shape[0]):
        for j in range(free.shape[1]):
            recount_free(maps, who, i, j, free[i, j])


@kernel
def sum_all(table, team, maps):
    world = world_at(table)
    for i in range(maps.truth.shape[1]):
        for j in range(maps.truth.shape[2]):
            sum_up(world, team, maps, i, j)


def test_free_cells_are_counted_by_their_difference():
    generator = np.random.default_rng(1)
    maps = drawn_maps(generator)
    maps.bits[1, ..., FREE] = 0
    for _ in range(3):
        free = generator.integers(0, 2**64, (ROWS, WORDS), np.uint64, endpoint=False)
        recount_all(maps, 1, free)
        assert maps.counts[1, COUNTED] == count(free & maps.truth[COUNTED])
        assert np.array_equal(maps.bits[1, ..., FREE], free)
    assert not maps.counts[[0, 2]].any()


def test_a_team_knows_what_any_robot_knows():
    env, generator = begun(), np.random.default_rng(2)
    maps = drawn_maps(generator)
    for _ in range(3):
        sum_all(env.simulation.table, Team(0, 2, False), maps)
        known = maps.bits[0, ..., KNOWN] | maps.bits[1, ..., KNOWN]
        assert maps.counts[2].tolist() == [count(known & maps.truth[0]), count(known & maps.truth[1]), 0]
        maps.bits[0, ..., KNOWN] = generator.integers(0, 2**64, (ROWS, WORDS), np.uint64, endpoint=False)


def test_of_what_maps_dispute_the_sum_decides():
    env = begun()
    scribbled(env, np.random.default_rng(4))
    on_floor = beliefs.maps_on_floor(env)
    bits = np.zeros((3, *env.score.counted_masks[0].shape, 2), np.uint64)
    for robot, own in enumerate(on_floor):
        bits[robot, ..., KNOWN], bits[robot, ..., FREE] = pack_bits(own != 0), pack_bits(own < 0)
    truth = np.full((3, *bits.shape[1:3]), 2**64 - 1, np.uint64)
    maps = CountedMaps(truth, bits, np.zeros(bits.shape[1:3], np.uint64), np.zeros((3, 3), np.int64))
    sum_all(env.simulation.table, Team(0, 2, True), maps)
    disputed = (on_floor < 0).any(axis=0) & (on_floor > 0).any(axis=0)
    assert count(maps.disputed) == disputed.sum() > 100
    assert np.array_equal(maps.bits[2, ..., FREE], pack_bits(on_floor.sum(axis=0, dtype=np.int16) < 0))


@pytest.mark.parametrize("row", [0, 1])
def test_maps_begin_as_many_cells_before_the_masks_as_their_corners_say(row):
    env = begun()
    assert cells_beyond(world_at(env.simulation.table), row, 0) == placed.cells_beyond(env.simulation, row, 0)
