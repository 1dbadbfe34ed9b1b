"""Pictures of a floor in three dimensions: from above, from behind a robot, through its camera."""

import math
from collections.abc import Sequence
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from lidarium.envs.drawing.frame_parts import INK, Colour, Frame, team_colours
from lidarium.envs.drawing.shading import Viewpoint, shade
from lidarium.envs.floors.faces import Faces, faces_of, section_of
from lidarium.envs.floors.floor import Floor
from lidarium.envs.settings.cameras import DepthCamera
from lidarium.envs.settings.robots import Robot
from lidarium.envs.simulation.depth.frames import image_of, place_camera
from lidarium.envs.simulation.disturbances.odometry import HEIGHT, RADIUS, TICKS_PER_METRE

CUT_M = 1.3
"""Height at which walls are cut in views from above [m]."""

ABOVE_FIELD_OF_VIEW, BEHIND_FIELD_OF_VIEW = math.radians(35.0), math.radians(65.0)
ABOVE_PITCH = math.radians(62.0)
BODY_NUMBERS = TICKS_PER_METRE + 1
"""Numbers of a body."""

BEHIND_M, OVER_M = 1.7, 1.5
"""Distance behind a robot, and above its top, of the eye that follows it [m]."""


class FloorViews:
    """Pictures of a floor with robots on it.

    Parameters
    ----------
    floor : Floor
        The floor to draw.
    radius, height : float
        Radius and height of the robots' bodies [m].
    colours : sequence of Colour
        Colours of the robots.
    """

    def __init__(self, floor: Floor, radius: float, height: float, colours: Sequence[Colour]) -> None:
        self.floor, self._size, self._colours = floor, (radius, height), list(colours)
        self._walls = np.array([floor.is_wall(solid) for solid in floor.solids], np.bool_)
        self._section, self._whole = section_of(floor, CUT_M), faces_of(floor)

    def from_above(self, poses: NDArray[np.float64], size: tuple[int, int]) -> Frame:
        """Return a picture of the whole floor from above, its walls cut.

        Parameters
        ----------
        poses : (robots, 3) float64
            x, y, theta [m, rad].
        size : (rows, columns)
            Size of the picture [pixels].
        """
        x_min, y_min, x_max, y_max = self.floor.bounds
        middle = np.array([(x_min + x_max) / 2.0, (y_min + y_max) / 2.0, 0.0])
        across = max(x_max - x_min, (y_max - y_min) * size[1] / size[0] * math.sin(ABOVE_PITCH))
        away = 0.56 * across / math.tan(0.5 * ABOVE_FIELD_OF_VIEW) + 0.25 * (y_max - y_min)
        eye = middle + away * np.array([0.0, -math.cos(ABOVE_PITCH), math.sin(ABOVE_PITCH)])
        return self._picture(self._section, Viewpoint.towards(eye, middle, ABOVE_FIELD_OF_VIEW), size, poses)

    def from_behind(self, poses: NDArray[np.float64], robot: int, size: tuple[int, int]) -> Frame:
        """Return a picture from behind a robot and above it, the walls cut."""
        x, y, heading = poses[robot]
        ahead = np.array([math.cos(heading), math.sin(heading), 0.0])
        place = np.array([x, y, self._size[1]])
        eye = place - BEHIND_M * ahead + (0.0, 0.0, OVER_M)
        return self._picture(
            self._section, Viewpoint.towards(eye, place + 0.8 * ahead, BEHIND_FIELD_OF_VIEW), size, poses
        )

    def of_camera(
        self,
        poses: NDArray[np.float64],
        attitudes: NDArray[np.float64],
        robot: int,
        camera: DepthCamera,
        size: tuple[int, int],
    ) -> Frame:
        """Return the view of a robot's camera in colours."""
        axes, eye = np.empty((3, 3)), np.empty(3)
        place_camera(poses[robot], attitudes[robot], camera.mount, axes, eye)
        return self._picture(self._whole, Viewpoint(eye, axes, camera.field_of_view), size, poses, without=robot)

    def depth(
        self, poses: NDArray[np.float64], attitudes: NDArray[np.float64], robot: int, camera: DepthCamera
    ) -> NDArray[np.float32]:
        """Return the depth image (rows, columns) of a robot, without noise [m]."""
        bodies = np.zeros((len(poses), BODY_NUMBERS))
        bodies[:, RADIUS], bodies[:, HEIGHT] = self._size
        return image_of(self._whole, poses, attitudes, bodies, robot, camera)

    def _picture(
        self,
        faces: Faces,
        viewpoint: Viewpoint,
        size: tuple[int, int],
        poses: NDArray[np.float64],
        without: int | None = None,
    ) -> Frame:
        shown = [robot for robot in range(len(poses)) if robot != without]
        bodies = np.array([(*poses[robot, :2], 0.0, *self._size) for robot in shown]).reshape(-1, 5)
        return shade(faces, viewpoint, size, bodies, [self._colours[robot] for robot in shown], self._walls)


def false_colours(depth: NDArray[np.float32], camera: DepthCamera, size: tuple[int, int]) -> Frame:
    """Return a depth image (rows, columns) in false colours: near is warm, no measurement dark."""
    share = np.clip((depth - camera.depth_min) / (camera.depth_max - camera.depth_min), 0.0, 1.0)
    levels = np.asarray(np.rint(255.0 * (1.0 - share)), np.uint8)
    coloured = cv2.cvtColor(cv2.applyColorMap(levels, cv2.COLORMAP_TURBO), cv2.COLOR_BGR2RGB)
    coloured[depth <= 0.0] = INK
    return np.asarray(cv2.resize(coloured, (size[1], size[0]), interpolation=cv2.INTER_NEAREST), np.uint8)


@lru_cache(maxsize=4)
def views_of(floor: Floor, robot: Robot, robots: int) -> FloorViews:
    """Return the views of a floor with a team on it; those used last are kept."""
    return FloorViews(floor, robot.radius, robot.height, team_colours(robots))


def camera_panel(
    views: FloorViews,
    poses: NDArray[np.float64],
    attitudes: NDArray[np.float64],
    depth: NDArray[np.float32],
    camera: DepthCamera,
    height: int,
) -> Frame:
    """Return a column of three pictures of the first robot, to be put next to a frame.

    From the top: from behind, the view of its camera in colours, its depth image.

    Parameters
    ----------
    poses, attitudes : (robots, 3) float64
        Poses and attitudes of the robots, see ``World``.
    depth : (rows, columns) float32
        The first robot's depth image [m].

    Returns
    -------
    (height, columns, 3) uint8
        The panel; its width is even.
    """
    width = round(height / 3 * camera.columns / camera.rows) // 2 * 2
    heights = [height // 3, height // 3, height - 2 * (height // 3)]
    return np.concatenate(
        [
            views.from_behind(poses, 0, (heights[0], width)),
            views.of_camera(poses, attitudes, 0, camera, (heights[1], width)),
            false_colours(depth, camera, (heights[2], width)),
        ]
    )
