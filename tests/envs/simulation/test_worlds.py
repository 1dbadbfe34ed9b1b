"""What every world does, whatever moves its bodies; and the fast one beside the plain one."""

from importlib.util import find_spec

import numpy as np
import pytest
from plain_world import PlainWorld
from scipy import ndimage

from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.floors.floor import Floor, Raster
from lidarium.envs.settings.lidar import Lidar
from lidarium.envs.settings.making import make_settings
from lidarium.envs.settings.robots import ROBOTS
from lidarium.envs.simulation.backends import BACKENDS, kinematic_world, simulation_of
from lidarium.envs.simulation.bullet.bullet_world import BulletWorld
from lidarium.envs.simulation.coverage import unpack_bits
from lidarium.envs.simulation.kernels.arrays import ENDED
from lidarium.envs.simulation.kernels.floor_cache import FloorTables
from lidarium.envs.simulation.kinematic_simulation import KinematicSimulation
from lidarium.envs.simulation.kinematic_world import KinematicWorld
from lidarium.envs.simulation.simulation import Simulation

WORLDS = {"kinematic": KinematicWorld, "plain": PlainWorld, "bullet": BulletWorld}
NEEDS_BULLET = pytest.mark.skipif(find_spec("pybullet") is None, reason="the extra bullet is not installed")
BULLET = pytest.param("bullet", marks=NEEDS_BULLET)
SLACK = {"bullet": 2e-3}
"""How far bodies that forces move may be off, where others are exact [m]."""

LIDAR = Lidar(beams=61, range_max=3.0)
CELL = 0.1


def room():
    """A room of 4 m x 3 m with a box and a post."""
    solid = np.zeros((30, 40), np.uint8)
    solid[[0, -1]], solid[:, [0, -1]] = 1, 1
    solid[10:14, 20:26], solid[20, 10] = 1, 1
    return Floor("room", (0.0, 0.0, 4.0, 3.0), cells=Raster(solid, (0.0, 0.0), CELL))


def tables():
    return FloorTables.of_floor(room(), CELL, 0.3, 0.6)


STARTS = np.array([[0.6, 0.6, 0.3], [3.2, 2.2, 3.0]])


def placed(kind, episodes=1, robot="kobuki"):
    world = WORLDS[kind]([ROBOTS[robot]] * 2, LIDAR, 0.1, episodes)
    floor = tables()
    for episode in range(episodes):
        world.place(episode, floor, STARTS, floor.body.solid == 0, episode)
    return world


def commands(seed, steps, rows=2):
    generator = np.random.default_rng(seed)
    held = generator.uniform((-0.2, -1.5), (0.8, 1.5), (steps // 10 + 1, rows, 2))
    return np.repeat(held, 10, axis=0)[:steps]


@pytest.fixture(params=["kinematic", "plain", BULLET])
def kind(request):
    return request.param


def test_arrays_have_their_shapes_and_keep_their_places(kind):
    world = placed(kind, episodes=3)
    shapes = {
        "bodies": (2, 8),
        "seeds": (3,),
        "steps": (3,),
        "starts": (6, 3),
        "poses": (6, 3),
        "velocities": (6, 2),
        "moves": (6,),
        "flags": (6,),
        "failed": (6,),
        "contacts": (6,),
        "travelled": (6,),
        "collisions": (6,),
        "true_ranges": (6, 61),
    }
    sensors = {"scan": (6, 61), "odometry": (6, 3), "velocity": (6, 2), "bumper": (6, 3)}
    assert {name: getattr(world, name).shape for name in shapes} == shapes
    assert {name: world.sensors[name].shape for name in sensors} == sensors
    assert world.faults.shape[0] == 6
    places = [getattr(world, name).ctypes.data for name in shapes]
    places += [world.sensors[name].ctypes.data for name in sensors]
    world.move_and_sense(np.zeros((6, 2)))
    world.place(1, tables(), STARTS, tables().body.solid == 0, 7)
    again = [getattr(world, name).ctypes.data for name in shapes]
    assert places == again + [world.sensors[name].ctypes.data for name in sensors]


def test_robots_begin_at_rest_at_their_starts_before_the_first_step(kind):
    world = placed(kind)
    assert np.array_equal(world.poses, STARTS)
    assert np.array_equal(world.starts, STARTS)
    assert not world.velocities.any()
    assert world.steps.tolist() == [-1]
    assert np.isinf(world.sensors["scan"]).all()
    world.move_and_sense(np.ones((2, 2)), moves_bodies=False)
    assert np.array_equal(world.poses, STARTS)
    assert np.isfinite(world.sensors["scan"]).any()
    assert world.steps.tolist() == [-1]


def test_limits_of_the_drive_hold(kind):
    world, robot, slack = placed(kind), ROBOTS["kobuki"], 5.0 * SLACK.get(kind, 2e-13)
    before = world.velocities.copy()
    for _ in range(20):
        world.move_and_sense(np.full((2, 2), 9.0))
        change = np.abs(world.velocities - before).max(axis=0)
        in_contact = world.contacts.any()
        assert (
            in_contact
            or (change <= np.array([robot.max_acceleration, robot.max_turn_acceleration]) * 0.1 + slack).all()
        )
        assert (np.abs(world.velocities) <= np.array([robot.max_speed, robot.max_turn_rate]) + slack).all()
        before = world.velocities.copy()


@pytest.mark.parametrize("seed", range(3))
def test_no_body_enters_a_wall_or_another_and_touching_is_noted(kind, seed):
    world, touched, slack = placed(kind), 0, SLACK.get(kind, 1e-9)
    body = tables().body
    rows, columns = np.nonzero(body.solid)
    low = np.stack([columns, rows], axis=1) * CELL + body.origin
    for command in commands(seed, 120):
        before = world.collisions.copy()
        world.move_and_sense(command)
        for pose in world.poses:
            gaps = pose[:2] - np.clip(pose[:2], low, low + CELL)
            assert np.hypot(*gaps.T).min() >= ROBOTS["kobuki"].radius - slack
        apart = np.hypot(*(world.poses[0, :2] - world.poses[1, :2]))
        assert apart >= 2 * ROBOTS["kobuki"].radius - slack
        assert (world.collisions - before <= world.contacts).all()
        touched += int(world.contacts.sum())
        assert ((world.sensors["bumper"].sum(axis=1) > 0) <= (world.contacts > 0)).all()
    assert touched > 0


def test_scans_end_at_walls_within_the_range(kind):
    world = placed(kind)
    for command in commands(1, 30):
        world.move_and_sense(command)
        scan = world.sensors["scan"]
        assert scan.dtype == np.float32
        assert ((scan > 0.0) & ((scan < LIDAR.range_max * (1 + 1e-6)) | np.isinf(scan))).all()
        assert np.array_equal(scan, world.true_ranges)


def test_only_the_chosen_episodes_run(kind):
    world = placed(kind, episodes=2)
    world.move_and_sense(np.ones((4, 2)), runs=np.array([False, True]))
    assert np.array_equal(world.poses[:2], STARTS)
    assert not np.array_equal(world.poses[2:], STARTS)
    assert np.isinf(world.sensors["scan"][:2]).all()


def test_who_has_ended_stands_and_senses_nothing_but_is_seen(kind):
    world = placed(kind)
    world.move_and_sense(np.zeros((2, 2)), moves_bodies=False)
    scan = world.sensors["scan"][1].copy()
    world.moves[1], world.flags[1] = 0, ENDED
    for command in commands(0, 20):
        world.move_and_sense(command)
    assert np.allclose(world.poses[1], STARTS[1], rtol=0.0, atol=SLACK.get(kind, 0.0))
    assert np.array_equal(world.sensors["scan"][1], scan)
    assert world.travelled[1] == 0.0


def test_the_same_commands_give_the_same_run_to_the_bit(kind):
    first, second = placed(kind), placed(kind)
    for command in commands(4, 40):
        first.move_and_sense(command)
        second.move_and_sense(command)
    assert np.array_equal(first.poses, second.poses)
    assert np.array_equal(first.sensors["scan"], second.sensors["scan"])


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("robot", ["kobuki", "pioneer"])
def test_the_fast_world_is_the_plain_one(seed, robot):
    fast, plain = placed("kinematic", robot=robot), placed("plain", robot=robot)
    for command in commands(seed, 80):
        fast.move_and_sense(command)
        plain.move_and_sense(command)
        assert np.allclose(fast.poses, plain.poses, atol=1e-9)
        assert np.allclose(fast.velocities, plain.velocities, atol=1e-7)
        assert np.array_equal(fast.contacts, plain.contacts)
        assert np.array_equal(fast.collisions, plain.collisions)
        assert np.array_equal(fast.sensors["bumper"], plain.sensors["bumper"])
        assert np.allclose(fast.travelled, plain.travelled, atol=1e-8)
        assert np.allclose(fast.true_ranges, plain.true_ranges, rtol=1e-5)


def make_plain(settings, episodes):
    return simulation_of(
        PlainWorld([settings.robot] * settings.robots, settings.lidar, settings.time_step, episodes), settings
    )


def make_staged(settings, episodes):
    return simulation_of(kinematic_world(settings, episodes), settings)


@pytest.fixture
def backends():
    BACKENDS.register("plain", make_plain, "for tests")
    BACKENDS.register("staged", make_staged, "for tests")
    yield
    BACKENDS.unregister("plain")
    BACKENDS.unregister("staged")


@pytest.mark.usefixtures("backends")
@pytest.mark.parametrize("backend", ["kinematic", "staged", "plain", BULLET])
def test_an_environment_runs_in_any_world(backend):
    options = {"raster_resolution": CELL, "resolution": CELL, "stop_coverage": None}
    settings = make_settings(robots=2, lidar=LIDAR, backend=backend, **options)
    env = ExplorationEnv(room(), settings)
    env.reset(seed=0, options={"starts": STARTS})
    start = env.scorer.coverage
    for command in commands(3, 60):
        _, rewards, *_, infos = env.step({agent: command[row] for row, agent in enumerate(env.agents)})
        assert sum(infos["robot_0"]["reward_terms"].values()) == pytest.approx(rewards["robot_0"], abs=1e-9)
    assert env.scorer.coverage > start
    # What the team knows of F is what it has sensed; a world of its own may round differently right at walls.
    counted = unpack_bits(env.score.counted_masks[0], env.beliefs.log_odds[0].shape[1])
    counted = ndimage.binary_erosion(counted, np.ones((3, 3))) if backend == "plain" else counted
    for log_odds, mask in zip(env.beliefs.log_odds, env.score.masks, strict=True):
        seen = unpack_bits(mask, log_odds.shape[1])
        assert np.array_equal(seen[counted], (log_odds != 0)[counted])


CASES = {
    "ideal": {},
    "noisy": {"noise": "datasheet", "odometry": "typical", "localization": "odometry"},
    "faulty": {
        "noise": "thesis",
        "faults": {"laser_dropout": 300.0, "blind_sector": 300.0, "stuck_wheel": 300.0},
    },
    "own_frames": {"known_starts": False, "observe": ("scan", "egocentric_map")},
}


@pytest.mark.parametrize("case", CASES)
def test_the_fused_step_is_the_three_parts_one_by_one(case):
    settings = make_settings(robots=3, lidar="lidar_360_6m", resolution=0.05, **CASES[case])
    fused = simulation_of(kinematic_world(settings, 2), settings, KinematicSimulation)
    parts = simulation_of(kinematic_world(settings, 2), settings, Simulation)
    floor = FloorTables.of_floor(room(), 0.05, settings.lidar.height, settings.robot.height)
    starts = np.vstack([STARTS, [[1.5, 2.2, -1.0]]])
    for simulation in (fused, parts):
        for episode in range(2):
            simulation.place(episode, floor, starts, 5 + episode, settings.known_starts)
        simulation.step(np.zeros((6, 2)), moves_bodies=False)
    for number, command in enumerate(commands(6, 60, 6)):
        runs = None if number % 7 else np.array([True, False])
        for simulation in (fused, parts):
            simulation.step(command, runs=runs)
    for name in ("poses", "velocities", "contacts", "travelled", "collisions", "failed", "steps", "flags"):
        assert np.array_equal(getattr(fused.world, name), getattr(parts.world, name)), name
    for name in fused.world.sensors:
        assert np.array_equal(fused.world.sensors[name], parts.world.sensors[name], equal_nan=True), name
    for name in ("believed", "windows"):
        assert np.array_equal(getattr(fused.beliefs, name), getattr(parts.beliefs, name)), name
    for name in ("seen", "gains", "rewards", "reward_terms", "team_seen"):
        assert np.array_equal(getattr(fused.score, name), getattr(parts.score, name)), name
    for one, other in zip(fused.beliefs.log_odds, parts.beliefs.log_odds, strict=True):
        assert np.array_equal(one, other)
    for one, other in zip(fused.score.masks, parts.score.masks, strict=True):
        assert np.array_equal(one, other)
