"""The scorer: masks against beliefs and against slow references, and who is credited with what."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scored_halls import hall, tables_of, team

from lidarium.envs.floors.catalogue.names import load_floor
from lidarium.envs.floors.floor import Floor, Solid
from lidarium.envs.floors.free_space import reachable_free_space
from lidarium.envs.simulation.coverage import count_bits, mark_seen, pack_bits, share_new_cells, unpack_bits
from lidarium.envs.simulation.kernels.floor_cache import FloorTables, floor_tables
from lidarium.envs.simulation.score import counted_cells
from lidarium.mapping.kernels.compilation import kernel


def starts_on(tables, count, generator, apart=0.6):
    room = np.argwhere(tables.bound * tables.body.resolution > 0.22)
    placed = []
    while len(placed) < count:
        row, column = room[generator.integers(len(room))]
        x, y = np.array(tables.body.origin) + (np.array([column, row]) + 0.5) * tables.body.resolution
        if all(math.dist((x, y), other[:2]) > apart for other in placed):
            placed.append((x, y, generator.uniform(-math.pi, math.pi)))
    return np.array(placed)


@given(rows=st.integers(1, 9), columns=st.integers(1, 200), seed=st.integers(0, 99))
@settings(max_examples=50)
def test_packing_and_unpacking_bits_is_lossless(rows, columns, seed):
    cells = np.random.default_rng(seed).random((rows, columns)) < 0.5
    bits = pack_bits(cells)
    assert bits.shape == (rows, -(-columns // 64))
    assert np.array_equal(unpack_bits(bits, columns), cells)
    assert np.bitwise_count(bits).sum() == cells.sum()


@kernel
def count_all(values, counts):
    for k in range(values.shape[0]):
        counts[k] = count_bits(values[k])


def test_counting_bits_is_exact_for_all_kinds_of_words():
    values = np.concatenate(
        [
            np.random.default_rng(0).integers(0, 2**64, 500, np.uint64),
            np.array([0, 1, 2**63, 2**64 - 1], np.uint64),
        ]
    )
    counts = np.zeros(len(values), np.int64)
    count_all(values, counts)
    assert np.array_equal(counts, np.bitwise_count(values))


@pytest.mark.parametrize("resolution", [0.025, 0.05])
@pytest.mark.parametrize("floor", ["apartment", "building:3"])
def test_in_the_ideal_world_belief_and_mask_agree_to_the_cell(resolution, floor):
    tables = floor_tables(load_floor(floor), 0.025, 0.3, 0.52)
    generator = np.random.default_rng(2)
    simulation = team(4, resolution)
    simulation.place(0, tables, starts_on(tables, 4, generator), 3)
    counted = unpack_bits(simulation.score.counted_masks[0], simulation.beliefs.log_odds[0].shape[1])
    for step in range(150):
        simulation.step(generator.uniform(-0.2, 1.0, (4, 2)) * [0.77, 1.2], moves_bodies=step > 0)
        if step % 30 == 0 or step == 149:
            for row in range(4):
                seen = unpack_bits(simulation.score.masks[row], counted.shape[1])
                known = simulation.beliefs.log_odds[row] != 0
                assert np.array_equal(seen, known & counted)
                assert not (simulation.beliefs.log_odds[row][counted] > 0).any()
                assert simulation.score.seen[row] == seen.sum()


@pytest.mark.parametrize("robots", [1, 2, 5])
def test_credits_are_equal_shares_of_what_is_new_to_the_team(robots):
    tables = floor_tables(load_floor("building:3"), 0.025, 0.3, 0.52)
    generator = np.random.default_rng(robots)
    simulation = team(robots)
    simulation.place(0, tables, starts_on(tables, robots, generator), 3)
    columns = simulation.beliefs.log_odds[0].shape[1]
    before = np.zeros((robots, simulation.beliefs.log_odds[0].shape[0], columns), bool)
    for step in range(80):
        simulation.step(generator.uniform(-0.2, 1.0, (robots, 2)) * [0.77, 1.2], moves_bodies=step > 0)
        after = np.array([unpack_bits(mask, columns) for mask in simulation.score.masks])
        new_to_team = after.any(axis=0) & ~before.any(axis=0)
        sharers = (after & new_to_team).sum(axis=0)
        expected = [(1.0 / sharers[mask & new_to_team]).sum() for mask in after]
        assert np.allclose(simulation.score.gains, expected, atol=1e-9)
        assert simulation.score.gains.sum() == pytest.approx(new_to_team.sum(), abs=1e-6)
        assert simulation.score.team_seen[0] == after.any(axis=0).sum()
        before = after


@given(seed=st.integers(0, 2**32 - 1), robots=st.integers(1, 6))
@settings(max_examples=60)
def test_sharing_news_equals_a_slow_count_cell_by_cell(seed, robots):
    generator = np.random.default_rng(seed)
    rows, columns = 12, 192
    counted = generator.random((rows, columns)) < 0.8
    owns = [generator.random((rows, columns)) < 0.1 for _ in range(robots)]
    owns = [own & counted for own in owns]
    team_seen = np.any(owns, axis=0)
    scans = [generator.random((rows, columns)) < 0.3 for _ in range(robots)]
    packed = [pack_bits(own) for own in owns]
    packed_team, packed_counted = pack_bits(team_seen), pack_bits(counted)
    news = np.zeros((robots, 4), np.int64)
    for k in range(robots):
        new_own = mark_seen(
            packed[k], packed_counted, pack_bits(scans[k]), (0, rows, 0, packed_team.shape[1]), 0, 0, news[k]
        )
        assert new_own == (scans[k] & counted & ~owns[k]).sum()
    gains = np.zeros(robots)
    total = share_new_cells(np.array([own.ctypes.data for own in packed]), packed_team, news, 0, robots, gains)
    fresh = [scan & counted & ~team_seen for scan in scans]
    sharers = np.sum(fresh, axis=0)
    assert np.allclose(gains, [(1.0 / sharers[mine]).sum() for mine in fresh])
    assert total == (sharers > 0).sum()
    assert np.array_equal(unpack_bits(packed_team, columns), team_seen | (sharers > 0))


def test_a_window_that_hangs_over_the_masks_is_cut():
    counted = np.ones((10, 64), bool)
    own = np.zeros((10, 1), np.uint64)
    bits = pack_bits(np.ones((20, 192), bool))
    news = np.zeros(4, np.int64)
    assert mark_seen(own, pack_bits(counted), bits, (0, 20, 0, bits.shape[1]), -5, -1, news) == 640
    assert news.tolist() == [0, 10, 0, 1]
    assert unpack_bits(own, 64).all()
    assert mark_seen(own, pack_bits(counted), bits, (0, 20, 0, bits.shape[1]), -5, -1, news) == 0
    assert news[0] >= news[1]


def test_coverage_never_falls_and_reaches_one_where_all_is_seen():
    simulation = team(1, beams=727)
    simulation.place(0, tables_of(hall(80, 100)), np.array([[1.2, 1.0, 0.0]]), 1)
    last = 0.0
    for step in range(80):
        simulation.step(np.array([[0.0, 1.5]]), moves_bodies=step > 0)
        assert simulation.score.coverage(0) >= last
        last = simulation.score.coverage(0)
    assert last == 1.0


def test_cells_behind_walls_and_in_sealed_rooms_never_count():
    solid = hall()
    solid[:, 120:124] = 1
    tables = tables_of(solid)
    simulation = team(1)
    simulation.place(0, tables, np.array([[1.5, 2.0, 0.0]]), 1)
    counted = unpack_bits(simulation.score.counted_masks[0], simulation.beliefs.log_odds[0].shape[1])
    assert not counted[:, 60:].any()
    assert counted[2:78, 2:58].mean() > 0.99
    for step in range(60):
        simulation.step(np.array([[0.0, 2.0]]), moves_bodies=step > 0)
    assert not unpack_bits(simulation.score.masks[0], counted.shape[1])[:, 60:].any()
    assert simulation.score.team_seen[0] <= counted.sum()


def test_the_cells_that_count_are_those_that_the_smallest_disc_sweeps():
    solid = hall()
    solid[60:100, 100:104] = 1
    tables = tables_of(solid)
    start = np.array([[1.5, 2.0, 0.0]])
    simulation = team(1, 0.05)
    simulation.place(0, tables, start, 1)
    swept = reachable_free_space(tables.body, 0.18, start)
    expected = counted_cells(swept, 2)
    counted = unpack_bits(simulation.score.counted_masks[0], simulation.beliefs.log_odds[0].shape[1])
    assert np.array_equal(counted[:, : expected.shape[1]], expected)
    assert not counted[:, expected.shape[1] :].any()
    # The corners of the hall are where a disc does not come.
    assert not counted[1, 1]


def test_noise_changes_the_map_and_not_the_score():
    generator = np.random.default_rng(8)
    tables = floor_tables(load_floor("building:3"), 0.025, 0.3, 0.52)
    starts = starts_on(tables, 2, generator)
    exact, noisy = team(2), team(2, noise=0.03)
    exact.place(0, tables, starts, 1)
    noisy.place(0, tables, starts, 1)
    for step in range(30):
        commands = generator.uniform(-0.2, 1.0, (2, 2)) * [0.77, 1.2]
        exact.step(commands, moves_bodies=step > 0)
        noisy.step(commands, moves_bodies=step > 0)
        assert np.array_equal(exact.score.gains, noisy.score.gains)
        assert exact.score.team_seen[0] == noisy.score.team_seen[0]
    assert not np.array_equal(exact.beliefs.log_odds[0], noisy.beliefs.log_odds[0])


def test_body_and_laser_share_their_tables_unless_something_stands_at_one_height_only():
    shelf = Solid(np.array([[2.0, 1.0], [2.2, 1.0], [2.2, 1.2], [2.0, 1.2]]), 0.6, 1.0)
    floor = Floor("hall", (0.0, 0.0, 4.0, 3.0), (shelf,))
    tables = FloorTables.of_floor(floor, 0.025, 0.3, 0.52)
    assert tables.laser is tables.body
    tables = FloorTables.of_floor(floor, 0.025, 0.7, 0.52)
    assert tables.laser is not tables.body
    assert tables.laser.solid.sum() > tables.body.solid.sum()
