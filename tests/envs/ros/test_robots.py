"""A robot is heard as its messages say, and bad messages are refused and counted."""

import math
import threading

import numpy as np
import pytest

pytest.importorskip("cyclonedds", reason="cyclonedds (extra ros) is not installed")

from ros_graphs import GEOMETRY, node, until

from lidarium.envs.ros.robots import RobotLink, Transforms, begin_driving, connected, names_of
from lidarium.mapping.files.bags.messages import POSE_STAMPED, TRANSFORMS, TWIST
from lidarium.mapping.grids.scan_geometry import ScanGeometry

NAMES = names_of("robot_0")
SCAN = np.full(GEOMETRY.beams, 2.0, np.float32)


class Robot:
    """Sends what a robot would, and lets its link read it."""

    def __init__(self, robot, driver, mount=(0.0, 0.0, 0.0), geometry=GEOMETRY):
        self.robot, self.geometry = robot, geometry
        robot.transform("base", "laser", 1.0, mount, is_static=True)
        self.link = RobotLink(driver, NAMES, Transforms(driver))
        self.odometry(0.9, (0.0, 0.0, 0.0))
        self.scan(1.0)
        until(lambda: robot.subscribers(NAMES.scan) and robot.subscribers(NAMES.odometry))
        until(lambda: driver._readers["/tf_static"][TRANSFORMS].get_matched_publications())
        until(self._begins)
        self.link.readings()

    def _begins(self):
        self.odometry(1.0, (0.0, 0.0, 0.0))
        self.scan(1.0)
        self.link._transforms.hear()
        return bool(self.link._transforms._known) and self.link.begin()

    def odometry(self, time_s, pose, velocity=(0.0, 0.0)):
        self.robot.odometry(NAMES.odometry, "odom", "base", time_s, pose, velocity)

    def scan(self, time_s, ranges=None, frame="laser"):
        self.robot.scan(NAMES.scan, frame, time_s, SCAN if ranges is None else ranges, self.geometry)

    def reading(self):
        found = []
        until(lambda: found.extend(self.link.readings()) or found)
        return found[-1]


@pytest.fixture
def nodes():
    with node("robot") as robot, node("driver") as driver:
        yield robot, driver


def test_a_reading_has_the_odometry_of_its_scan(nodes):
    robot = Robot(*nodes)
    robot.odometry(2.0, (1.0, 0.0, 0.0), (0.3, 0.1))
    robot.odometry(2.2, (1.2, 0.0, 0.2), (0.5, 0.2))
    robot.scan(2.1)
    reading = robot.reading()
    assert reading.stamp_s == pytest.approx(2.1)
    np.testing.assert_allclose(reading.odometry, [1.1, 0.0, 0.1], atol=0.01)
    assert reading.velocity == (0.3, 0.1)
    assert reading.mapped is None


def test_transforms_say_where_the_robot_is_on_the_map(nodes):
    robot = Robot(*nodes)
    robot.robot.transform("map", "odom", 1.0, (5.0, 6.0, math.pi / 2))
    until(lambda: robot.link._transforms.hear() or robot.link.start() is not None)
    robot.odometry(2.0, (1.0, 0.0, 0.0))
    robot.scan(2.0)
    np.testing.assert_allclose(robot.reading().mapped, [5.0, 7.0, math.pi / 2], atol=1e-9)


def test_robots_with_transforms_of_their_own_may_have_the_same_frames(nodes):
    robot, driver = nodes
    team = [names_of(f"robot_{k}", has_transforms=True) for k in range(2)]
    for k, names in enumerate(team):
        robot.transform("base", "laser", 1.0, (0.1 * k, 0.0, 0.0), is_static=True, topic=f"{names.transforms}_static")
    sending, over = threading.Thread(target=lambda: _send(robot, team, over)), threading.Event()
    sending.start()
    try:
        links = connected(driver, team, 20.0, on_map=True)
    finally:
        over.set()
        sending.join()
    assert [link._mounting.pose[0] for link in links] == pytest.approx([0.0, 0.1])
    assert [link.start()[0] for link in links] == pytest.approx([0.0, 5.0])


def _send(robot, team, over):
    time_s = 1.0
    while not over.wait(0.02):
        time_s += 0.1
        for k, names in enumerate(team):
            robot.transform("map", "odom", time_s, (5.0 * k, 0.0, 0.0), topic=names.transforms)
            robot.odometry(names.odometry, "odom", "base", time_s, (0.0, 0.0, 0.0), (0.0, 0.0))
            robot.scan(names.scan, "laser", time_s, SCAN, GEOMETRY)


def test_scans_in_another_frame_or_back_in_time_are_refused_and_counted(nodes):
    robot = Robot(*nodes)
    robot.odometry(5.0, (0.0, 0.0, 0.0))
    robot.scan(4.0, frame="camera")
    robot.scan(4.5)
    robot.reading()
    robot.scan(2.0)
    until(lambda: robot.link.readings() or len(nodes[1].refused) == 2)
    assert nodes[1].refused == {"/robot_0/scan: in another frame": 1, "/robot_0/scan: back in time": 1}


def test_a_clock_that_is_set_back_for_good_is_followed(nodes):
    robot = Robot(*nodes)
    robot.odometry(50.0, (0.0, 0.0, 0.0))
    robot.scan(50.0)
    robot.reading()
    found = []
    for k in range(40):
        robot.odometry(2.0 + 0.1 * k, (0.5, 0.0, 0.0))
        robot.scan(2.0 + 0.1 * k)
        until(lambda: nodes[1].wait(0.1))
        found += robot.link.readings()
        if found:
            break
    assert found[0].stamp_s < 10.0
    np.testing.assert_allclose(found[0].odometry, [0.5, 0.0, 0.0], atol=1e-9)
    assert nodes[1].refused["/robot_0/scan: back in time"] == 9


def test_a_clock_that_is_set_back_is_followed_in_transforms_too(nodes):
    robot, driver = nodes
    robot.advertise("/tf", TRANSFORMS)
    link = RobotLink(driver, NAMES, Transforms(driver))
    link._base = "base"
    until(lambda: robot.subscribers("/tf"))
    for time_s, x in ((49.9, 0.1), (50.0, 0.2), (2.0, 0.5), (2.1, 0.6)):
        robot.transform("odom", "base", time_s, (x, 0.0, 0.0))
        until(lambda x=x: link._hear_odometry() or (link._wheels and link._wheels[-1].pose[0] == x))
    assert link._stamps == pytest.approx([2.0, 2.1])
    assert link._wheels[-1].velocity == pytest.approx((1.0, 0.0))


@pytest.mark.parametrize("pose", [(math.nan, 0.0, 0.0), (1e12, 0.0, 0.0)])
def test_odometry_that_is_no_pose_is_refused(nodes, pose):
    robot = Robot(*nodes)
    robot.odometry(2.0, pose)
    until(lambda: robot.link.readings() or nodes[1].refused)
    assert nodes[1].refused == {"/robot_0/odom: not a pose in metres": 1}


@pytest.mark.parametrize(
    "geometry",
    [
        {"angle_min": math.nan},
        {"angle_increment": 1e-12, "angle_max": -math.pi / 2},
        {"range_min": math.nan},
        {"range_min": 9.0},
        {"ranges": np.zeros(0, np.float32)},
        {"ranges": np.ones(20_000, np.float32)},
    ],
)
def test_scans_without_usable_beams_are_refused(nodes, geometry):
    robot = Robot(*nodes)
    robot.odometry(2.0, (0.0, 0.0, 0.0))
    write = robot.robot._write
    robot.robot._write = lambda *arguments, **fields: write(*arguments, **{**fields, **geometry})
    robot.scan(2.0)
    until(lambda: robot.link.readings() or nodes[1].refused)
    assert nodes[1].refused == {"/robot_0/scan: no beams that can be used": 1}


def test_frames_without_end_are_refused(nodes):
    robot, driver = nodes
    transforms = Transforms(driver)
    robot.advertise("/tf", TRANSFORMS)
    until(lambda: robot.subscribers("/tf"))
    for first in range(0, 300, 50):
        for k in range(first, first + 50):
            robot.transform(f"frame_{k}", "base", 1.0, np.zeros(3))
        robot.transform("map", "x" * 600, 1.0, np.zeros(3))
        until(lambda: driver.wait(0.1))
        transforms.hear()
    until(lambda: transforms.hear() or len(driver.refused) == 2)
    assert len(transforms.moving) == 256


def test_a_scan_with_other_beams_is_brought_into_the_directions_of_the_first(nodes):
    robot = Robot(*nodes)
    robot.geometry = ScanGeometry(beams=361, field_of_view=math.pi, range_min=0.1, range_max=8.0)
    robot.odometry(2.0, (0.0, 0.0, 0.0))
    robot.scan(2.0, np.linspace(2.0, 3.0, 361).astype(np.float32))
    np.testing.assert_allclose(robot.reading().ranges, np.linspace(2.0, 3.0, GEOMETRY.beams), atol=1e-4)


@pytest.mark.parametrize("mount", [(0.2, 0.0, 0.0), (-0.1, 0.1, math.pi / 2), (0.0, 0.0, math.pi)])
def test_a_laser_mounted_elsewhere_sees_the_wall_where_it_is(nodes, mount):
    whole = ScanGeometry(beams=720, field_of_view=2.0 * math.pi, range_min=0.1, range_max=8.0)
    x, y, theta = mount
    bearing = whole.angles + theta + 1e-6  # along no wall
    # A square room of 4 m around the robot's middle.
    with np.errstate(divide="ignore"):
        sides = [(np.sign(d) * 2.0 - p) / d for d, p in ((np.cos(bearing), x), (np.sin(bearing), y))]
    ranges = np.minimum(*sides).astype(np.float32)
    robot = Robot(*nodes, mount=mount, geometry=whole)
    robot.odometry(2.0, (0.0, 0.0, 0.0))
    robot.scan(2.0, ranges)
    found = robot.reading().ranges
    own = robot.link.geometry.angles
    expected = 2.0 / np.maximum(np.abs(np.cos(own)), np.abs(np.sin(own)))
    is_known = np.isfinite(found)
    assert is_known.mean() > 0.9
    np.testing.assert_allclose(found[is_known], expected[is_known], atol=0.02)


def test_a_silent_robot_is_named_with_its_domain(nodes):
    with pytest.raises(ValueError, match=r"in domain \d+ nothing usable came on /robot_0/scan and /robot_0/odom"):
        connected(nodes[1], [NAMES], 0.3)


def test_a_robot_with_a_driver_gets_no_second_one(nodes):
    with node("other") as other:
        other.velocity(NAMES.command, None, 0.0, (0.1, 0.0))
        until(lambda: nodes[1].publishers(NAMES.command))
        with pytest.raises(ValueError, match="/robot_0/cmd_vel is published by another node already"):
            begin_driving(nodes[1], {NAMES.command: TWIST})


def test_commands_that_nobody_reads_are_named(nodes):
    nodes[0].subscribe(NAMES.command, TWIST)
    unread = begin_driving(nodes[1], {NAMES.command: TWIST, NAMES.goal: POSE_STAMPED}, 0.5)
    assert unread == [NAMES.goal]
