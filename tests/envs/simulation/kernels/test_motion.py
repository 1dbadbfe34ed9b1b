"""Bodies against a slow reference: arcs by tiny steps, contact of discs with squares and discs by plain
geometry."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lidarium.envs.settings.robots import ROBOTS, Robot
from lidarium.envs.simulation.kernels.contact import BodyGrids, TeamBodies, distance_bound
from lidarium.envs.simulation.kernels.motion import move_robots

RESOLUTION = 0.025
KOBUKI = Robot()
UNLIMITED = Robot(max_speed=5.0, cruise_speed=1.0, max_turn_rate=50.0, max_acceleration=1e6, max_turn_acceleration=1e6)


class Bodies:
    """A floor with robots that ``move_robots`` drives."""

    def __init__(self, solid, poses, robots, origin=(0.0, 0.0), resolution=RESOLUTION):
        self.solid, self.bound = solid, distance_bound(solid)
        self.frame = np.array([*origin, resolution])
        self.poses = np.array(poses, np.float64).reshape(-1, 3)
        count = len(self.poses)
        self.robots = robots if isinstance(robots, list) else [robots] * count
        self.numbers = np.stack([robot.numbers for robot in self.robots])
        self.moves, self.velocities = np.ones(count, np.uint8), np.zeros((count, 2))
        self.bumpers, self.contacts = np.zeros((count, 3), np.int8), np.zeros(count, np.uint8)
        self.travelled, self.collisions = np.zeros(count), np.zeros(count, np.int64)

    def step(self, commands, duration=0.1):
        team = TeamBodies(
            self.numbers,
            self.moves,
            self.poses,
            self.velocities,
            self.bumpers,
            self.contacts,
            self.travelled,
            self.collisions,
        )
        wanted = np.array(commands, np.float64).reshape(-1, 2)
        move_robots(BodyGrids(self.bound, self.solid, self.frame), team, wanted, duration)
        return self

    def penetration(self):
        """How far the deepest disc reaches into a solid square or another disc [m]."""
        depth = -math.inf
        rows, columns = np.nonzero(self.solid)
        low_x, low_y = self.frame[0] + columns * self.frame[2], self.frame[1] + rows * self.frame[2]
        for k, (x, y, _) in enumerate(self.poses):
            gap_x = np.maximum(np.maximum(low_x - x, x - low_x - self.frame[2]), 0.0)
            gap_y = np.maximum(np.maximum(low_y - y, y - low_y - self.frame[2]), 0.0)
            depth = max(depth, self.robots[k].radius - float(np.hypot(gap_x, gap_y).min()))
            for other in range(k):
                apart = math.dist((x, y), self.poses[other, :2])
                depth = max(depth, self.robots[k].radius + self.robots[other].radius - apart)
        return depth


def hall(rows=160, columns=200):
    solid = np.zeros((rows, columns), np.uint8)
    solid[0], solid[-1], solid[:, 0], solid[:, -1] = 1, 1, 1, 1
    return solid


def euler(pose, speed, turn_rate, duration, steps=20_000):
    x, y, heading = pose
    for _ in range(steps):
        piece = duration / steps
        heading += 0.5 * turn_rate * piece
        x, y = x + speed * piece * math.cos(heading), y + speed * piece * math.sin(heading)
        heading += 0.5 * turn_rate * piece
    return x, y, heading


@pytest.mark.parametrize(
    ("speed", "turn_rate"),
    [(0.5, 0.0), (0.5, 1.0), (-0.3, 2.0), (0.7, -3.0), (0.0, 2.0), (0.4, 1e-10), (0.4, 1e-7)],
)
def test_a_free_arc_is_exact(speed, turn_rate):
    bodies = Bodies(hall(), [2.0, 2.0, 0.7], UNLIMITED).step([speed, turn_rate])
    assert np.allclose(bodies.poses[0], euler((2.0, 2.0, 0.7), speed, turn_rate, 0.1), atol=1e-9)
    assert bodies.contacts[0] == 0
    assert bodies.travelled[0] == pytest.approx(math.dist((2.0, 2.0), bodies.poses[0, :2]))


def test_a_free_arc_in_pieces_near_a_wall_is_the_same_arc():
    far, near = Bodies(hall(), [2.5, 2.0, 0.4], UNLIMITED), Bodies(hall(), [2.5, 0.23, 0.4], UNLIMITED)
    for _ in range(5):
        far.step([0.3, 0.5])
        near.step([0.3, 0.5])
    assert near.contacts[0] == 0
    assert np.allclose(near.poses[0] - [2.5, 0.23, 0.4], far.poses[0] - [2.5, 2.0, 0.4], atol=1e-9)


@given(
    seed=st.integers(0, 2**32 - 1),
    robots=st.integers(1, 5),
    density=st.sampled_from([0.0, 0.002, 0.01]),
    kind=st.sampled_from(["kobuki", "pioneer", "point", "fast"]),
)
@settings(max_examples=60)
def test_no_robot_ever_is_inside_a_wall_or_another_robot(seed, robots, density, kind):
    generator = np.random.default_rng(seed)
    robot = UNLIMITED if kind == "fast" else ROBOTS[kind]
    solid = hall(70, 90) | (generator.random((70, 90)) < density).astype(np.uint8)
    placed = []
    for _ in range(300):
        pose = [
            generator.uniform(0.05, 2.2),
            generator.uniform(0.05, 1.7),
            generator.uniform(-math.pi, math.pi),
        ]
        if Bodies(solid, [*placed, pose], robot).penetration() < -1e-3:
            placed.append(pose)
        if len(placed) == robots:
            break
    if not placed:
        return
    bodies = Bodies(solid, placed, robot)
    wanted = np.zeros((len(placed), 2))
    for step in range(60):
        if step % 6 == 0:
            wanted = generator.uniform(-1.0, 1.0, (len(placed), 2)) * [
                robot.max_speed,
                min(robot.max_turn_rate, 4.0),
            ]
        before = bodies.poses.copy()
        bodies.step(wanted)
        assert bodies.penetration() <= 1e-6
        gone = np.hypot(*(bodies.poses - before)[:, :2].T)
        assert (gone <= np.abs(bodies.numbers[:, 1]) * 0.1 + 1e-6).all()


@pytest.mark.parametrize("angle", [10.0, 30.0, 60.0])
def test_a_robot_that_slides_along_a_wall_keeps_its_speed_along_it(angle):
    bodies = Bodies(hall(), [1.0, RESOLUTION + 0.18 + 1e-4, -math.radians(angle)], UNLIMITED)
    for _ in range(10):
        x = bodies.poses[0, 0]
        bodies.step([0.5, 0.0])
        assert bodies.poses[0, 0] - x == pytest.approx(0.05 * math.cos(math.radians(angle)), rel=1e-3)
        assert bodies.penetration() <= 1e-6
    assert bodies.contacts[0] == 1
    assert bodies.collisions[0] == 1


def test_sliding_over_the_seams_of_a_flat_wall_never_catches():
    bodies = Bodies(hall(), [0.5, RESOLUTION + 0.18 + 1e-9, -0.05], UNLIMITED)
    for _ in range(50):
        bodies.step([0.6, 0.0])
    assert bodies.poses[0, 0] == pytest.approx(0.5 + 50 * 0.06 * math.cos(0.05), rel=1e-3)


def test_a_robot_stops_before_a_wall_ahead_with_its_edge_on_it():
    bodies = Bodies(hall(), [1.0, 2.0, math.pi], KOBUKI)
    for _ in range(60):
        bodies.step([0.5, 0.0])
    assert bodies.poses[0, 0] == pytest.approx(RESOLUTION + 0.18, abs=1e-6)
    assert bodies.poses[0, 1] == pytest.approx(2.0, abs=1e-9)
    assert bodies.collisions[0] == 1
    assert abs(bodies.velocities[0, 0]) < 0.11


@pytest.mark.parametrize(
    ("heading", "speed", "pressed"),
    [
        (math.pi, 0.3, [0, 1, 0]),
        (math.pi + math.radians(45), 0.3, [0, 0, 1]),
        (math.pi - math.radians(45), 0.3, [1, 0, 0]),
        (math.pi + math.radians(20), 0.3, [0, 1, 0]),
        (math.pi - math.radians(80), 0.3, [1, 0, 0]),
        (0.0, -0.3, [0, 0, 0]),
    ],
)
def test_the_bumper_on_the_side_of_contact_is_pressed(heading, speed, pressed):
    """The wall is at -x: a robot whose heading is turned to the left of it has it on its right."""
    bodies = Bodies(hall(), [RESOLUTION + 0.18 + 1e-4, 2.0, heading], UNLIMITED).step([speed, 0.0])
    assert bodies.contacts[0] == 1
    assert bodies.bumpers[0].tolist() == pressed


def test_bumpers_are_released_when_the_robot_drives_away():
    bodies = Bodies(hall(), [RESOLUTION + 0.18 + 1e-4, 2.0, math.pi], UNLIMITED).step([0.3, 0.0])
    assert bodies.bumpers[0].any()
    bodies.step([-0.3, 0.0]).step([-0.3, 0.0])
    assert not bodies.bumpers[0].any()
    assert bodies.contacts[0] == 0


@given(commands=st.lists(st.tuples(st.floats(-3.0, 3.0), st.floats(-9.0, 9.0)), min_size=1, max_size=25))
@settings(max_examples=50)
def test_limits_of_speed_and_acceleration_hold(commands):
    bodies = Bodies(hall(), [2.5, 2.0, 0.0], KOBUKI)
    for command in commands:
        before = bodies.velocities.copy()
        bodies.step(command)
        speed, turn_rate = bodies.velocities[0]
        assert abs(speed) <= KOBUKI.max_speed
        assert abs(turn_rate) <= KOBUKI.max_turn_rate
        assert abs(turn_rate - before[0, 1]) <= KOBUKI.max_turn_acceleration * 0.1 + 1e-12
        if bodies.contacts[0] == 0:
            assert abs(speed - before[0, 0]) <= KOBUKI.max_acceleration * 0.1 + 1e-12


def test_a_command_within_the_limits_is_reached_and_held():
    bodies = Bodies(hall(), [1.0, 2.0, 0.0], KOBUKI)
    speeds = [float(bodies.step([0.33, 0.0]).velocities[0, 0]) for _ in range(6)]
    assert speeds == pytest.approx([0.1, 0.2, 0.3, 0.33, 0.33, 0.33])


def test_a_robot_that_stands_is_not_moved_by_others():
    bodies = Bodies(hall(), [[1.0, 2.0, 0.0], [1.6, 2.0, 0.0], [2.0, 2.3, 1.0]], KOBUKI)
    bodies.moves[1] = 0
    standing = bodies.poses[1:].copy()
    for _ in range(40):
        bodies.step([[0.5, 0.0], [0.5, 0.0], [0.0, 0.0]])
    assert np.array_equal(bodies.poses[1:], standing)
    assert bodies.contacts[0] == 1
    assert bodies.poses[0, 0] == pytest.approx(1.6 - 0.36, abs=1e-5)
    assert np.array_equal(bodies.velocities[1], [0.0, 0.0])


def test_a_robot_turns_on_the_spot_between_two_walls_without_contact():
    solid = hall()
    solid[40:60], solid[75:] = 1, 1
    bodies = Bodies(solid, [2.0, 1.6875, 0.0], KOBUKI)
    for _ in range(40):
        bodies.step([0.0, 3.0])
    assert np.allclose(bodies.poses[0, :2], [2.0, 1.6875])
    assert bodies.contacts[0] == 0


def test_a_contact_that_lasts_counts_once_and_a_new_one_again():
    bodies = Bodies(hall(), [0.5, 2.0, math.pi], UNLIMITED)
    for speed in [0.6] * 20 + [-0.6] * 5 + [0.6] * 20:
        bodies.step([speed, 0.0])
    assert bodies.collisions[0] == 2


def test_headings_stay_within_the_half_open_circle():
    bodies = Bodies(hall(), [2.5, 2.0, math.pi], UNLIMITED)
    for _ in range(100):
        bodies.step([0.0, 7.0])
        assert -math.pi < bodies.poses[0, 2] <= math.pi


@pytest.mark.parametrize(
    "options",
    [
        {"radius": 0.0},
        {"height": -1.0},
        {"max_speed": math.inf},
        {"max_turn_rate": math.nan},
        {"cruise_speed": 2.0},
        {"max_acceleration": 0.0},
    ],
)
def test_a_robot_that_cannot_be_is_refused(options):
    with pytest.raises(ValueError, match=next(iter(options))):
        Robot(**options)
