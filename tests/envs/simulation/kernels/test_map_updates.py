"""The two stages of a step: fused or not, serial or parallel, alone or in a batch, the same to the bit."""

import copy
import math
import pickle

import numpy as np
import pytest

from lidarium.envs.floors.catalogue.names import load_floor
from lidarium.envs.floors.floor import Raster
from lidarium.envs.settings.lidar import Lidar
from lidarium.envs.settings.robots import ROBOTS
from lidarium.envs.simulation.kernels.arrays import ENDED, KNOWN_TEAMMATES
from lidarium.envs.simulation.kernels.contact import distance_bound
from lidarium.envs.simulation.kernels.floor_cache import FloorTables, floor_tables
from lidarium.envs.simulation.kernels.ray_tables import RayTables
from lidarium.envs.simulation.kinematic_simulation import KinematicSimulation
from lidarium.mapping.grids.occupancy import OccupancyGrid, OccupancySettings
from lidarium.mapping.grids.scan_geometry import ScanGeometry

STATE = (
    "poses",
    "velocities",
    "believed",
    "ranges",
    "bumpers",
    "contacts",
    "travelled",
    "collisions",
    "gains",
    "seen",
    "team_seen",
    "windows",
)


@pytest.fixture(scope="module")
def tables():
    return floor_tables(load_floor("building:3"), 0.025, 0.3, 0.52)


def starts_on(tables, count, generator, apart=0.6):
    """Poses anywhere on a floor where bodies have room."""
    room = np.argwhere(tables.bound * tables.body.resolution > 0.22)
    placed = []
    while len(placed) < count:
        row, column = room[generator.integers(len(room))]
        x, y = np.array(tables.body.origin) + (np.array([column, row]) + 0.5) * tables.body.resolution
        if all(math.dist((x, y), other[:2]) > apart for other in placed):
            placed.append((x, y, generator.uniform(-math.pi, math.pi)))
    return np.array(placed)


def simulation(robots=3, episodes=1, noise=0.0, threads=1, resolution=0.05, beams=181):
    lidar = Lidar(beams=beams, noise_floor=noise, noise_share=noise)
    return KinematicSimulation.of_team(
        [ROBOTS["kobuki"]] * robots,
        lidar,
        OccupancySettings(resolution=resolution),
        episodes=episodes,
        threads=threads,
    )


def array_of(simulation, name):
    """The array of a simulation, of whichever of its parts has it."""
    owners = (simulation.world, simulation.beliefs, simulation.score, simulation)
    return next(getattr(owner, name) for owner in owners if hasattr(owner, name))


def same(one, other, rows=slice(None), other_rows=slice(None)):
    for name in STATE:
        if name != "team_seen":
            assert np.array_equal(array_of(one, name)[rows], array_of(other, name)[other_rows]), name
    for a, b in zip(one.beliefs.log_odds[rows], other.beliefs.log_odds[other_rows], strict=True):
        assert np.array_equal(a, b)
    for a, b in zip(one.score.masks[rows], other.score.masks[other_rows], strict=True):
        assert np.array_equal(a, b)


def commands_of(generator, rows):
    return generator.uniform(-0.3, 1.0, (rows, 2)) * [0.77, 1.5]


@pytest.mark.parametrize("noise", [0.0, 0.01])
@pytest.mark.parametrize("known", [True, False])
@pytest.mark.parametrize("resolution", [0.025, 0.05])
def test_the_fused_step_is_the_two_stages_one_after_the_other(tables, noise, known, resolution):
    generator = np.random.default_rng(1)
    fused, staged = (
        simulation(noise=noise, resolution=resolution),
        simulation(noise=noise, resolution=resolution),
    )
    starts = starts_on(tables, 3, generator)
    for each in (fused, staged):
        each.place(0, tables, starts, 5, known)
        each.step(np.zeros((3, 2)), moves_bodies=False)
    for _ in range(200):
        commands = commands_of(generator, 3)
        fused.step(commands)
        staged.step(commands, perceives=False)
        staged.perceive()
        assert np.array_equal(staged.ranges, fused.ranges)
        assert np.array_equal(staged.world.steps, fused.world.steps)
        same(fused, staged)
        assert staged.score.team_seen[0] == fused.score.team_seen[0]
    assert fused.score.team_seen[0] > 1000
    assert fused.world.collisions.sum() > 0


def test_serial_and_parallel_kernels_agree_to_the_bit(tables):
    generator = np.random.default_rng(2)
    serial, parallel = simulation(16, noise=0.01), simulation(16, noise=0.01, threads=2)
    assert (serial.threads, parallel.threads) == (1, 2)
    starts = starts_on(tables, 16, generator)
    for each in (serial, parallel):
        each.place(0, tables, starts, 8)
    for step in range(40):
        commands = commands_of(generator, 16)
        serial.step(commands, moves_bodies=step > 0)
        parallel.step(commands, moves_bodies=step > 0)
        same(serial, parallel)
        assert serial.score.team_seen[0] == parallel.score.team_seen[0]


@pytest.mark.parametrize("threads", [1, 2])
def test_four_episodes_in_a_batch_are_four_worlds_alone(tables, threads):
    generator = np.random.default_rng(3)
    other_floor = floor_tables(load_floor("building:4"), 0.025, 0.3, 0.52)
    floors = [tables, other_floor, tables, other_floor]
    batch, alone = (
        simulation(2, 4, noise=0.01, threads=threads),
        [simulation(2, noise=0.01) for _ in range(4)],
    )
    for episode in range(4):
        starts = starts_on(floors[episode], 2, generator)
        batch.place(episode, floors[episode], starts, 100 + episode, known_starts=episode != 2)
        alone[episode].place(0, floors[episode], starts, 100 + episode, known_starts=episode != 2)
    for step in range(60):
        commands = commands_of(generator, 8)
        batch.step(commands, moves_bodies=step > 0)
        for episode in range(4):
            rows = slice(2 * episode, 2 * episode + 2)
            alone[episode].step(commands[rows], moves_bodies=step > 0)
            same(batch, alone[episode], rows)
            assert batch.score.team_seen[episode] == alone[episode].score.team_seen[0]
            assert batch.score.coverage(episode) == alone[episode].score.coverage(0)


def test_an_episode_placed_anew_forgets_the_old_one_and_leaves_the_others(tables):
    generator = np.random.default_rng(4)
    batch, alone = simulation(2, 2, noise=0.01), simulation(2, noise=0.01)
    first, second = starts_on(tables, 2, generator), starts_on(tables, 2, generator)
    batch.place(0, tables, first, 1)
    batch.place(1, tables, second, 2)
    for _ in range(20):
        batch.step(commands_of(generator, 4))
    batch.place(0, tables, second, 7)
    alone.place(0, tables, second, 7)
    for step in range(20):
        commands = commands_of(generator, 4)
        batch.step(commands, moves_bodies=step > 0)
        alone.step(commands[:2], moves_bodies=step > 0)
        same(batch, alone, slice(0, 2))


@pytest.mark.parametrize("how", ["pickle", "deepcopy"])
def test_a_world_copied_in_mid_episode_goes_on_alike_and_apart(tables, how):
    generator = np.random.default_rng(5)
    original = simulation(noise=0.01)
    original.place(0, tables, starts_on(tables, 3, generator), 5)
    for _ in range(20):
        original.step(commands_of(generator, 3))
    copied = pickle.loads(pickle.dumps(original)) if how == "pickle" else copy.deepcopy(original)
    frozen = copied.beliefs.log_odds[0].copy()
    commands = [commands_of(generator, 3) for _ in range(20)]
    for each in commands:
        original.step(each)
    assert np.array_equal(copied.beliefs.log_odds[0], frozen)
    for each in commands:
        copied.step(each)
    same(original, copied)


def test_unknown_starts_give_the_same_map_in_the_frame_of_the_start(tables):
    """With the start at a cell's corner and unturned, the two maps hold the same cells."""
    generator = np.random.default_rng(6)
    start = starts_on(tables, 1, generator)
    start[0, :2] = np.round((start[0, :2] - tables.laser.origin) / 0.05) * 0.05 + tables.laser.origin
    start[0, 2] = 0.0
    known, own = simulation(1), simulation(1)
    known.place(0, tables, start, 1, True)
    own.place(0, tables, start, 1, False)
    for step in range(30):
        commands = commands_of(generator, 1)
        known.step(commands, moves_bodies=step > 0)
        own.step(commands, moves_bodies=step > 0)
    assert np.allclose(own.beliefs.believed[0], known.beliefs.believed[0] - [*start[0, :2], 0.0], atol=1e-9)
    column, row = (
        np.round((np.array(own.beliefs.origins[0]) + start[0, :2] - known.beliefs.origins[0]) / 0.05)
    ).astype(int)
    rows, columns = np.nonzero(known.beliefs.log_odds[0])
    there = own.beliefs.log_odds[0][rows - row, columns - column]
    assert (there == known.beliefs.log_odds[0][rows, columns]).mean() > 0.999
    assert np.array_equal(known.score.masks[0], own.score.masks[0])


def test_the_map_is_that_of_the_occupancy_grid_fed_with_the_same_scans(tables):
    generator = np.random.default_rng(7)
    one = simulation(1, noise=0.01)
    one.place(0, tables, starts_on(tables, 1, generator), 1)
    one.world.flags[:] &= ~KNOWN_TEAMMATES
    lidar = one.lidars[0]
    geometry = ScanGeometry(beams=lidar.beams, field_of_view=lidar.field_of_view, range_max=lidar.range_max)
    grid = OccupancyGrid(OccupancySettings(resolution=0.05))
    for step in range(30):
        one.step(commands_of(generator, 1), moves_bodies=step > 0)
        grid.integrate(one.world.poses[0], one.ranges[0], geometry, noise=(0.01, 0.01))
    column, row = (round((a - b) / 0.05) for a, b in zip(grid.origin, one.beliefs.origins[0], strict=True))
    rows, columns = np.nonzero(one.beliefs.log_odds[0])
    assert (grid.log_odds[rows - row, columns - column] == one.beliefs.log_odds[0][rows, columns]).mean() > 0.999


def hall(rows=160, columns=240):
    solid = np.zeros((rows, columns), np.uint8)
    solid[0], solid[-1], solid[:, 0], solid[:, -1] = 1, 1, 1, 1
    raster = Raster(solid, (0.0, 0.0), 0.025)
    return FloorTables(raster, raster, RayTables(solid), distance_bound(solid))


def test_robots_see_each_other_but_known_teammates_stay_out_of_the_map():
    starts = np.array([[2.0, 2.0, 0.0], [3.5, 2.0, 0.0]])
    for known in (True, False):
        pair = simulation(2)
        pair.place(0, hall(), starts, 1, known)
        pair.step(np.zeros((2, 2)), moves_bodies=False)
        assert pair.ranges[0, 90] == pytest.approx(1.5 - 0.18, abs=1e-6)
        x, y = pair.beliefs.believed[0, :2] - pair.beliefs.origins[0] + [1.5 - 0.175, 0.0]
        assert (pair.beliefs.log_odds[0][int(y / 0.05), int(x / 0.05)] > 0) != known


def test_a_robot_too_low_for_the_laser_is_not_seen():
    pair = KinematicSimulation.of_team([ROBOTS["pioneer"]] * 2, Lidar(beams=181), OccupancySettings())
    pair.place(0, hall(), np.array([[2.0, 2.0, 0.0], [3.5, 2.0, 0.0]]), 1)
    pair.step(np.zeros((2, 2)), moves_bodies=False)
    assert pair.ranges[0, 90] == pytest.approx(239 * 0.025 - 2.0, abs=1e-5)


def test_an_ended_robot_stays_as_a_body_with_its_sensors_off():
    pair = simulation(2)
    pair.place(0, hall(), np.array([[2.0, 2.0, 0.0], [2.6, 2.0, 0.0]]), 1)
    pair.step(np.zeros((2, 2)), moves_bodies=False)
    pair.world.flags[1] |= ENDED
    pair.world.moves[1] = 0
    ranges, log_odds, mask = (
        pair.ranges[1].copy(),
        pair.beliefs.log_odds[1].copy(),
        pair.score.masks[1].copy(),
    )
    for _ in range(30):
        pair.step(np.array([[0.5, 0.0], [0.5, 0.5]]))
    assert np.array_equal(pair.world.poses[1], [2.6, 2.0, 0.0])
    assert np.array_equal(pair.ranges[1], ranges)
    assert np.array_equal(pair.beliefs.log_odds[1], log_odds)
    assert np.array_equal(pair.score.masks[1], mask)
    assert pair.score.gains[1] == 0.0
    assert pair.world.poses[0, 0] == pytest.approx(2.6 - 0.36, abs=1e-5)
    assert pair.ranges[0, 90] == pytest.approx(0.18, abs=1e-5)


def test_the_window_of_changes_holds_every_cell_that_changed(tables):
    generator = np.random.default_rng(9)
    team = simulation(2, noise=0.01)
    team.place(0, tables, starts_on(tables, 2, generator), 1)
    for step in range(40):
        before = [log_odds.copy() for log_odds in team.beliefs.log_odds]
        team.beliefs.forget_changes(0, 2)
        team.step(commands_of(generator, 2), moves_bodies=step > 0)
        for row in range(2):
            changed = np.argwhere(team.beliefs.log_odds[row] != before[row])
            low_row, high_row, low_column, high_column = team.beliefs.windows[row]
            assert changed[:, 0].min() >= low_row
            assert changed[:, 0].max() < high_row
            assert changed[:, 1].min() >= low_column
            assert changed[:, 1].max() < high_column


def test_a_map_cell_that_is_no_multiple_of_the_rasters_is_refused(tables):
    with pytest.raises(ValueError, match="whole multiple"):
        simulation(1, resolution=0.04).place(0, tables, starts_on(tables, 1, np.random.default_rng(0)), 1)
