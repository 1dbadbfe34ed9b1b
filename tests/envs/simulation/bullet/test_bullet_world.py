"""Bodies in PyBullet: what a plane cannot show, and what stays as it is in the kinematic world."""

import math
from dataclasses import replace

import numpy as np
import pytest

import lidarium
from lidarium.envs.floors.floor import Floor, Solid
from lidarium.envs.floors.generation.furniture import place
from lidarium.envs.settings.lidar import Lidar
from lidarium.envs.settings.robots import ROBOTS
from lidarium.envs.simulation.kernels.arrays import BROKEN_PHYSICS
from lidarium.envs.simulation.kernels.floor_cache import FloorTables
from lidarium.envs.simulation.kinematic_world import KinematicWorld

pytest.importorskip("pybullet", reason="the extra bullet is not installed")
from lidarium.envs.simulation.bullet.bullet_world import BulletWorld

LIDAR = Lidar(beams=61, range_max=3.0)


def hall(*solids):
    """An empty hall of 8 m x 6 m, with what else stands there."""
    return Floor("hall", (0.0, 0.0, 8.0, 6.0), tuple(solids))


def box(x_low, y_low, x_high, y_high, z_low=0.0, z_high=math.inf):
    return Solid(np.array([(x_low, y_low), (x_high, y_low), (x_high, y_high), (x_low, y_high)]), z_low, z_high)


def placed(floor, starts, robot="kobuki", kind=BulletWorld, lidar=LIDAR, seed=0, **options):
    body = ROBOTS[robot]
    world = kind([body] * len(starts), lidar, 0.1, 1, **options)
    tables = FloorTables.of_floor(floor, 0.025, lidar.height, body.height)
    world.place(0, tables, np.array(starts), tables.body.solid == 0, seed)
    return world


def drive(world, speed, turn_rate=0.0, steps=20):
    for _ in range(steps):
        world.move_and_sense(np.full((world.robots, 2), (speed, turn_rate)))


@pytest.mark.parametrize("robot", ["kobuki", "pioneer", "service"])
def test_free_driving_follows_the_kinematic_world(robot):
    start, body = [(4.0, 3.0, 0.7)], ROBOTS[robot]
    worlds = [placed(hall(), start, robot, kind) for kind in (BulletWorld, KinematicWorld)]
    generator = np.random.default_rng(3)
    for _ in range(10):
        command = generator.uniform((-0.2, -0.5), (0.3, 0.5), 2) * (body.max_speed, body.max_turn_rate)
        for world in worlds:
            drive(world, *command, steps=10)
    gap = worlds[0].poses[0] - worlds[1].poses[0]
    assert math.hypot(*gap[:2]) < 0.05
    assert abs(math.remainder(gap[2], math.tau)) < math.radians(3.0)
    assert worlds[0].travelled[0] == pytest.approx(worlds[1].travelled[0], abs=0.05)
    assert np.abs(worlds[0].attitudes[0]).max() < math.radians(1.0)


@pytest.mark.parametrize("robot", sorted(ROBOTS))
def test_the_wheels_of_every_robot_measure_its_way_at_its_full_speed(robot):
    world = placed(hall(), [(1.0, 3.0, 0.0)], robot)
    drive(world, min(ROBOTS[robot].max_speed, 1.5), steps=30)
    assert world.odometry[0, 0] == pytest.approx(world.poses[0, 0] - 1.0, rel=0.02)
    assert world.odometry[0, 0] > 0.5 * min(ROBOTS[robot].max_speed, 1.5)


def test_scans_are_the_kinematic_ones_at_the_bodys_pose_to_the_bit():
    floor, noisy = (
        hall(box(5.0, 2.0, 5.6, 3.1), *place("table", 2.0, 4.0, 0.3)),
        replace(LIDAR, noise_floor=0.02),
    )
    bullet = placed(floor, [(2.0, 2.0, 0.2), (4.0, 4.0, -1.0)], lidar=noisy)
    plain = placed(floor, [(2.0, 2.0, 0.2), (4.0, 4.0, -1.0)], kind=KinematicWorld, lidar=noisy)
    for _ in range(10):
        drive(bullet, 0.4, 0.3, 1)
        bullet.steps += 1
        plain.poses[:], plain.steps[:] = bullet.poses, bullet.steps - 1
        plain.move_and_sense(np.zeros((2, 2)), moves_bodies=False)
        assert np.array_equal(plain.true_ranges, bullet.true_ranges)
        assert np.array_equal(plain.ranges, bullet.ranges)


@pytest.mark.parametrize(
    ("bearing", "pressed"), [(0.0, [0, 1, 0]), (1.0, [1, 0, 0]), (-1.0, [0, 0, 1]), (math.pi, [0, 0, 0])]
)
def test_bumpers_tell_the_side_of_a_contact(bearing, pressed):
    # A post that stands so close that the body touches it from the beginning.
    reach = ROBOTS["kobuki"].radius + 0.05 - 1e-3
    x, y = 4.0 + reach * math.cos(bearing), 3.0 + reach * math.sin(bearing)
    angles = np.linspace(0.0, math.tau, 24, endpoint=False)
    post = Solid(np.stack([x + 0.05 * np.cos(angles), y + 0.05 * np.sin(angles)], axis=1))
    world = placed(hall(post), [(4.0, 3.0, 0.0)])
    world.poses[0, :2] = 4.0, 3.0
    world.bodies_of(0).put(0, world.poses[0])
    drive(world, 0.0, steps=1)
    assert world.contacts[0] == 1
    assert world.bumpers[0].tolist() == pressed


def test_contact_stops_the_wheels_and_begins_once():
    world = placed(hall(box(5.0, 0.0, 5.2, 6.0)), [(4.3, 3.0, 0.0)])
    drive(world, 0.5, steps=30)
    assert world.contacts[0] == 1
    assert world.bumpers[0].tolist() == [0, 1, 0]
    assert world.collisions[0] == 1
    assert abs(world.velocities[0, 0]) < 0.02
    assert world.poses[0, 0] == pytest.approx(5.0 - 0.18, abs=2e-3)
    drive(world, -0.3, steps=10)
    assert world.contacts[0] == 0
    assert world.poses[0, 0] < 4.7


def test_wheels_that_slip_make_odometry_differ_from_the_truth():
    slippery = replace(ROBOTS["kobuki"], build=replace(ROBOTS["kobuki"].build, wheel_friction=0.01))
    world = BulletWorld([slippery], LIDAR)
    tables = FloorTables.of_floor(hall(), 0.025, LIDAR.height, slippery.height)
    world.place(0, tables, np.array([(2.0, 3.0, 0.0)]), tables.body.solid == 0, 0)
    drive(world, 0.7, steps=20)
    assert world.odometry[0, 0] > world.poses[0, 0] - 2.0 + 0.1


@pytest.mark.parametrize(("robot", "passes"), [("kobuki", True), ("service", False)])
def test_a_table_top_is_missed_by_the_laser_hit_by_the_tall_and_passed_under_by_the_low(robot, passes):
    table = place("table", 4.0, 3.0, math.pi / 2, width=1.4, depth=0.8)
    world = placed(hall(*table), [(2.5, 3.0, 0.0)], robot)
    world.move_and_sense(np.zeros((1, 2)), moves_bodies=False)
    assert np.isinf(world.true_ranges[0, LIDAR.beams // 2])
    drive(world, 0.5, steps=70)
    assert (world.poses[0, 0] > 4.9) == passes
    assert (world.collisions[0] == 0) == passes
    if not passes:
        assert world.poses[0, 0] == pytest.approx(3.3 - 0.30, abs=5e-3)


def test_a_push_tilts_a_robot_and_a_hard_one_fells_it():
    world = placed(hall(), [(4.0, 3.0, 0.0), (6.0, 3.0, math.pi)], "service")
    drive(world, 0.0, steps=2)
    world.move_and_sense(np.zeros((2, 2)))
    upright = world.true_ranges[0].copy()
    bodies, leaned = world.bodies_of(0), 0.0
    for _ in range(40):
        bodies.push(0, (0.0, 20_000.0, 0.0), 1.1)
        world.move_and_sense(np.ones((2, 2)) * 0.1)
        leaned = max(leaned, float(np.hypot(*world.attitudes[0, 1:])))
        if 0.05 < leaned < 0.5:
            # One side looks at the ground, the other over what it saw.
            assert not np.array_equal(upright, world.true_ranges[0])
    assert leaned > math.radians(30.0)
    assert world.failed.tolist() == [1, 0]
    assert world.moves.tolist() == [0, 1]


def test_numbers_that_are_none_break_the_episode():
    world = placed(hall(), [(4.0, 3.0, 0.0), (6.0, 3.0, math.pi)])
    bodies = world.bodies_of(0)
    bodies.client.call("resetBaseVelocity", 2, (math.nan, 0.0, 0.0), (0.0, 0.0, 0.0))
    drive(world, 0.1, steps=2)
    assert (world.failed == BROKEN_PHYSICS).all()
    assert np.isfinite(world.poses).all()
    world.place(0, world.floors[0], world.starts.copy(), world.floors[0].body.solid == 0, 1)
    drive(world, 0.3, steps=5)
    assert not world.failed.any()
    assert (world.travelled > 0.02).all()


def test_robots_press_each_other():
    world = placed(hall(), [(3.0, 3.0, 0.0), (4.0, 3.0, math.pi)])
    drive(world, 0.3, steps=30)
    assert world.bumpers.tolist() == [[0, 1, 0], [0, 1, 0]]
    assert world.collisions.tolist() == [1, 1]
    assert math.hypot(*(world.poses[0, :2] - world.poses[1, :2])) == pytest.approx(0.36, abs=3e-3)


def test_bent_and_holed_solids_are_as_they_are_drawn():
    corner = Solid(np.array([(3.0, 1.0), (6.0, 1.0), (6.0, 4.0), (5.0, 4.0), (5.0, 2.0), (3.0, 2.0)]))
    world = placed(hall(corner), [(4.0, 3.0, 0.0), (3.5, 4.5, -math.pi / 2)])
    drive(world, 0.5, steps=60)
    assert world.poses[0, 0] == pytest.approx(4.82, abs=3e-3)
    assert world.poses[1, 1] == pytest.approx(2.18, abs=3e-3)


def test_a_copy_is_refused():
    import copy

    with pytest.raises(TypeError, match="cannot be copied"):
        copy.deepcopy(placed(hall(), [(4.0, 3.0, 0.0)]))


def test_a_robot_that_loses_the_ground_has_fallen():
    env = lidarium.parallel_env("apartment", backend="bullet", robots=1, starts="fixed")
    env.reset(seed=0)
    bodies = env.world.bodies_of(0)
    bodies.client.call("removeBody", bodies._ground)
    reasons = set()
    for _ in range(5):
        if env.agents:
            *_, infos = env.step({"robot_0": np.zeros(2, np.float32)})
            reasons |= {info["ended_because"] for info in infos.values() if "ended_because" in info}
    assert env.world.attitudes[0, 0] < -0.05
    assert reasons == {"failed"}
    env.close()
