"""What a page draws of one robot: body, believed pose, scan, path, plan, goal, depth image, sparse map."""

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from lidarium.envs.drawing.frame_parts import EXPLORED, Colour
from lidarium.envs.settings.robots import Robot
from lidarium.evaluation.viewing import meshes
from lidarium.evaluation.viewing.controls import Layer
from lidarium.evaluation.viewing.moment import RobotMoment, body_rotation

if TYPE_CHECKING:
    from viser import SceneApi

TRAIL_HEIGHT, PLAN_HEIGHT, GOAL_HEIGHT, BELIEVED_HEIGHT = 0.02, 0.05, 0.06, 0.07
LINE = 0.035
"""Thickness of lines [m]."""

_NOWHERE = np.zeros((0, 2, 3), np.float32)


class RobotNodes:
    """The nodes of a robot in a scene.

    Parameters
    ----------
    scene : SceneApi
        Of viser.
    agent : str
        The robot's name.
    colour : Colour
        Its colour.
    robot : Robot
        Its body.

    Attributes
    ----------
    layers : list of (Layer, node)
        What belongs to which layer.
    """

    def __init__(self, scene: "SceneApi", agent: str, colour: Colour, robot: Robot) -> None:
        self._scene, self._agent, self._colour = scene, agent, colour
        root = f"/robots/{agent}"
        self._body = scene.add_frame(root, show_axes=False)
        for name, mesh, shade in (
            ("trunk", meshes.body_mesh(robot.radius, robot.height), colour),
            ("nose", meshes.nose_mesh(robot.radius, robot.height), EXPLORED),
        ):
            scene.add_mesh_simple(f"{root}/{name}", mesh.vertices, mesh.triangles, color=shade, side="double")
        scene.add_label(
            f"{root}/name", agent, position=(0.0, 0.0, robot.height + 0.25), anchor="bottom-center"
        )
        # In the floor's frame: a slow browser shows an old scan where it was, not turned with the body.
        self._scans = scene.add_frame(f"/scans/{agent}", show_axes=False)
        self._scan = scene.add_frame(f"/scans/{agent}/last", show_axes=False)
        self._hits = self._points(f"/scans/{agent}/last/hits", colour, 0.035)
        self._cloud = self._points(f"/clouds/{agent}", colour, 0.02)
        outline = meshes.segments(meshes.circle(1.3 * robot.radius), BELIEVED_HEIGHT)
        ahead = meshes.segments(robot.radius * np.array([(1.0, 0.0), (1.9, 0.0)]), BELIEVED_HEIGHT)
        self._believed = self._lines(f"/believed/{agent}", np.concatenate([outline, ahead]), LINE)
        self._trail = self._lines(f"/trails/{agent}", _NOWHERE, LINE)
        self._plans = scene.add_frame(f"/plans/{agent}", show_axes=False)
        self._plan = self._lines(f"/plans/{agent}/path", _NOWHERE, 0.7 * LINE)
        goal = np.concatenate(
            [meshes.segments(meshes.circle(share * robot.radius), GOAL_HEIGHT) for share in (0.3, 0.9)]
        )
        self._goal = self._lines(f"/plans/{agent}/goal", goal, LINE)
        self._boxes = scene.add_frame(f"/boxes/{agent}", show_axes=False)
        self._drawn_boxes = np.zeros((0, 2, 3))
        self._fan: Any = None
        self.layers: list[tuple[Layer, Any]] = [
            (Layer.ROBOTS, self._body),
            (Layer.BELIEVED, self._believed),
            (Layer.SCANS, self._scans),
            (Layer.TRAILS, self._trail),
            (Layer.PLANS, self._plans),
            (Layer.CLOUDS, self._cloud),
            (Layer.BOXES, self._boxes),
        ]

    def draw(self, robot: RobotMoment) -> None:
        """Show the robot at another time."""
        x, y, _ = robot.pose
        self._body.position = (x, y, robot.attitude[0])
        self._body.wxyz = body_rotation(robot.pose, robot.attitude).as_quat(scalar_first=True)
        self._believed.position, self._believed.wxyz = _on_ground(robot.believed)
        self._draw_scan(robot)
        self._trail.points = meshes.segments(robot.trail, TRAIL_HEIGHT)
        self._plan.points = meshes.segments(robot.plan, PLAN_HEIGHT)
        self._goal.visible = robot.goal is not None
        if robot.goal is not None:
            self._goal.position = (*robot.goal, 0.0)
        self._cloud.points = robot.cloud
        self._draw_boxes(robot)

    def _draw_scan(self, robot: RobotMoment) -> None:
        self._scan.visible = not robot.has_ended
        self._hits.points = robot.ends[robot.is_hit].astype(np.float32)
        fan = meshes.fan_mesh(robot.laser, robot.ends)
        if self._fan is not None:
            self._fan.vertices = fan.vertices
            return
        self._fan = self._scene.add_mesh_simple(
            f"/scans/{self._agent}/last/fan",
            fan.vertices,
            fan.triangles,
            color=self._colour,
            opacity=0.14,
            side="double",
            cast_shadow=False,
            receive_shadow=False,
        )

    def _draw_boxes(self, robot: RobotMoment) -> None:
        self._boxes.position, self._boxes.wxyz = _on_ground(robot.boxes_pose)
        if np.array_equal(robot.boxes, self._drawn_boxes):
            return
        self._drawn_boxes = robot.boxes.copy()
        mesh = meshes.boxes_mesh(robot.boxes)
        self._scene.add_mesh_simple(
            f"/boxes/{self._agent}/all",
            mesh.vertices,
            mesh.triangles,
            color=self._colour,
            opacity=0.55,
            flat_shading=True,
        )

    def _points(self, name: str, colour: Colour, size: float) -> Any:  # noqa: ANN401
        return self._scene.add_point_cloud(
            name,
            np.zeros((0, 3), np.float32),
            colour,
            point_size=size,
            point_shape="circle",
            point_shading="flat",
            precision="float32",
        )

    def _lines(self, name: str, points: NDArray[np.float32], thickness: float) -> Any:  # noqa: ANN401
        return self._scene.add_line_segments(name, points, self._colour, thickness=thickness)


def _on_ground(pose: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the place (3,) [m] and the quaternion w, x, y, z of x, y, theta (3,)."""
    x, y, theta = pose
    return np.array([x, y, 0.0]), Rotation.from_euler("z", theta).as_quat(scalar_first=True)
