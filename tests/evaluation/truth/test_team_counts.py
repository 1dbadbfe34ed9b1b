"""Bits of a team's map, and what is counted of them."""

import numpy as np
import pytest
from seen_truth import begun, scribbled

from lidarium.envs.simulation.coverage import pack_bits
from lidarium.envs.simulation.kernels.arrays import world_at
from lidarium.evaluation.truth import beliefs
from lidarium.evaluation.truth.team_counts import (
    COUNTED,
    FREE,
    KNOWN,
    CountedMaps,
    Team,
    cells_beyond,
    recount_free,
    sum_up,
)
from lidarium.mapping.kernels.compilation import kernel

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
    assert cells_beyond(world_at(env.simulation.table), row, 0) == beliefs.cells_beyond(env, row)
