"""A robot is drawn where it is, with what it senses, plans and maps."""

import math

import numpy as np
import pytest
from recorded_scene import RecordedServer
from scipy.spatial.transform import Rotation

from lidarium.envs.settings.robots import ROBOTS
from lidarium.evaluation.viewing.controls import Layer
from lidarium.evaluation.viewing.moment import NO_BOXES, NO_CLOUD, NO_POINTS, RobotMoment
from lidarium.evaluation.viewing.robot_nodes import PLAN_HEIGHT, TRAIL_HEIGHT, RobotNodes

KOBUKI, RED = ROBOTS["kobuki"], (200, 30, 30)
ENDS = np.array([[3.0, 2.0, 0.3], [2.0, 4.0, 0.3], [1.0, 2.0, 0.3]])
BOXES = np.array([[(0.0, 0.0, 0.0), (1.0, 1.0, 2.0)]])


def moment(**changes):
    values = {
        "pose": np.array([2.0, 2.0, math.pi / 2]),
        "believed": np.array([2.1, 1.9, math.pi]),
        "attitude": np.zeros(3),
        "has_ended": False,
        "laser": np.array([2.0, 2.0, 0.3]),
        "ends": ENDS,
        "is_hit": np.array([True, False, True]),
        "trail": np.array([[1.0, 1.0], [2.0, 1.0], [2.0, 2.0]]),
        "plan": NO_POINTS,
        "goal": None,
        "cloud": NO_CLOUD,
        "boxes": NO_BOXES,
        "boxes_pose": np.array([1.0, -1.0, 0.5]),
    }
    return RobotMoment(**{**values, **changes})


def drawn(*moments):
    server = RecordedServer()
    nodes = RobotNodes(server.scene, "robot_0", RED, KOBUKI)
    for each in moments:
        nodes.draw(each)
    return server.scene.nodes, nodes


def is_turn(wxyz, *angles):
    """Whether a quaternion turns by roll, pitch and yaw."""
    gap = Rotation.from_quat(wxyz, scalar_first=True) * Rotation.from_euler("xyz", angles).inv()
    return gap.magnitude() < 1e-9


def test_the_body_stands_where_it_is_and_leans_as_it_does():
    nodes, _ = drawn(moment(attitude=np.array([0.02, 0.1, -0.2])))
    body = nodes["/robots/robot_0"]
    assert body.position == pytest.approx((2.0, 2.0, 0.02))
    assert is_turn(body.wxyz, 0.1, -0.2, math.pi / 2)
    believed = nodes["/believed/robot_0"]
    assert believed.position == pytest.approx((2.1, 1.9, 0.0))
    assert is_turn(believed.wxyz, 0.0, 0.0, math.pi)
    trunk = np.asarray(nodes["/robots/robot_0/trunk"].given[0])
    assert np.hypot(*trunk[:, :2].T).max() == pytest.approx(KOBUKI.radius)
    assert trunk[:, 2].max() == pytest.approx(KOBUKI.height)


def test_beams_that_met_something_are_points_and_all_make_the_fan():
    nodes, _ = drawn(moment(), moment(ends=ENDS + 1.0))
    assert nodes["/scans/robot_0/last/hits"].points == pytest.approx(ENDS[[0, 2]] + 1.0)
    fan = nodes["/scans/robot_0/last/fan"].vertices
    assert all((np.abs(fan - end).max(axis=1) < 1e-6).any() for end in ENDS + 1.0)
    assert not (np.abs(fan - ENDS[0]).max(axis=1) < 1e-6).any()
    assert nodes["/scans/robot_0/last"].visible
    assert not drawn(moment(has_ended=True))[0]["/scans/robot_0/last"].visible


def test_paths_plans_and_goals_lie_on_the_ground():
    plan = np.array([[2.0, 2.0], [3.0, 2.0]])
    nodes, _ = drawn(moment(plan=plan, goal=np.array([3.0, 2.0])))
    trail = nodes["/trails/robot_0"].points
    assert trail.shape == (2, 2, 3)
    assert trail[0] == pytest.approx(np.array([[1.0, 1.0, TRAIL_HEIGHT], [2.0, 1.0, TRAIL_HEIGHT]]))
    path = nodes["/plans/robot_0/path"].points
    assert path == pytest.approx(np.array([[[2.0, 2.0, PLAN_HEIGHT], [3.0, 2.0, PLAN_HEIGHT]]]))
    goal = nodes["/plans/robot_0/goal"]
    assert goal.visible
    assert goal.position == (3.0, 2.0, 0.0)
    nodes, _ = drawn(moment(plan=plan, goal=np.array([3.0, 2.0])), moment())
    assert not nodes["/plans/robot_0/goal"].visible
    assert len(nodes["/plans/robot_0/path"].points) == 0


def test_boxes_are_sent_again_only_when_they_have_changed():
    nodes, robot = drawn(moment(boxes=BOXES))
    frame, mesh = nodes["/boxes/robot_0"], nodes["/boxes/robot_0/all"]
    assert frame.position == pytest.approx((1.0, -1.0, 0.0))
    assert is_turn(frame.wxyz, 0.0, 0.0, 0.5)
    robot.draw(moment(boxes=BOXES.copy()))
    assert nodes["/boxes/robot_0/all"] is mesh
    robot.draw(moment(boxes=BOXES + 1.0))
    assert nodes["/boxes/robot_0/all"] is not mesh
    assert np.asarray(nodes["/boxes/robot_0/all"].given[0]).min() == 1.0
    assert "/boxes/robot_0/all" not in drawn(moment())[0]


def test_a_depth_image_is_a_cloud_of_points():
    cloud = np.array([[1.0, 2.0, 0.5]], np.float32)
    assert np.array_equal(drawn(moment(cloud=cloud))[0]["/clouds/robot_0"].points, cloud)


def test_what_is_drawn_belongs_to_layers():
    nodes, robot = drawn()
    of_layers = dict(robot.layers)
    assert of_layers[Layer.ROBOTS] is nodes["/robots/robot_0"]
    assert of_layers[Layer.PLANS] is nodes["/plans/robot_0"]
    assert of_layers[Layer.BOXES] is nodes["/boxes/robot_0"]
    # Of those of a floor and its maps there is one for all robots.
    assert set(Layer) - set(of_layers) == {Layer.FLOOR, Layer.JOINED, Layer.OWN, Layer.FRONTIERS}
