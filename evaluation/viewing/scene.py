"""The scene of a page: what is drawn once for a floor, and what moves."""

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.drawing.frame_parts import UNEXPLORED, Colour, Frame, team_colours
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.evaluation.viewing import meshes
from lidarium.evaluation.viewing.controls import Layer
from lidarium.evaluation.viewing.maps import TeamMaps
from lidarium.evaluation.viewing.moment import Moment
from lidarium.evaluation.viewing.robot_nodes import RobotNodes

if TYPE_CHECKING:
    from viser import ViserServer

FRONTIER: Colour = (219, 39, 119)
FRONTIER_HEIGHT = 0.03
FIELD_OF_VIEW = math.radians(50.0)
"""Upright angle that a browser sees at first [rad]."""

PANEL_SHARE = 0.13
"""How far to the right of the floor a browser looks at first, as a share of its distance."""

BACKGROUND: Colour = (246, 247, 249)


class TeamScene:
    """What a page draws of a run.

    Parameters
    ----------
    server : ViserServer
        Whose page.
    env : ExplorationEnv
        After a reset.
    maps : TeamMaps
        Where the maps lie.
    """

    def __init__(self, server: "ViserServer", env: ExplorationEnv, maps: TeamMaps) -> None:
        self._scene = server.scene
        floor = env.floor
        assert floor is not None
        self._floor, self._height = floor, 0.0
        self._walls: list[Any] = []
        (x, y), (width, tall) = maps.corner, maps.size
        blank = np.full((2, 2, 3), UNEXPLORED, np.uint8)
        middle = np.array([x + 0.5 * width, y + 0.5 * tall, 0.0])
        self._ground = self._scene.add_image(
            "/ground", blank, width, tall, format="png", position=middle, wxyz=(0.0, 1.0, 0.0, 0.0)
        )
        self._frontiers = self._scene.add_point_cloud(
            "/frontiers",
            np.zeros((0, 3), np.float32),
            FRONTIER,
            point_size=0.6 * maps.cell_m,
            point_shape="circle",
            point_shading="flat",
            precision="float32",
        )
        colours = team_colours(env.settings.robots)
        self._robots = [
            RobotNodes(self._scene, agent, colours[row], env.settings.team[row])
            for row, agent in enumerate(env.possible_agents)
        ]
        self._scene.configure_default_lights(cast_shadow=False)
        self._scene.set_background_image(np.full((2, 2, 3), BACKGROUND, np.uint8))
        _look_at(server, middle, width, tall)

    def cut_walls(self, height: float) -> None:
        """Show the true floor, cut at a height [m]."""
        if height == self._height:
            return
        self._height = height
        for wall in self._walls:
            wall.remove()
        self._walls = [
            self._scene.add_mesh_simple(
                f"/floor/{number}",
                mesh.vertices,
                mesh.triangles,
                color=colour,
                flat_shading=True,
                side="double",
            )
            for number, (colour, mesh) in enumerate(meshes.floor_meshes(self._floor, height).items())
        ]

    def draw_ground(self, picture: Frame, frontiers: NDArray[np.float64]) -> None:
        """Show the maps as a picture, and the frontiers (N, 2) [m]."""
        self._ground.image = picture
        lifted = np.column_stack([frontiers, np.full(len(frontiers), FRONTIER_HEIGHT)])
        self._frontiers.points = lifted.astype(np.float32)

    def draw(self, moment: Moment) -> None:
        """Show robots, and what they sense and plan."""
        for nodes, robot in zip(self._robots, moment.robots, strict=True):
            nodes.draw(robot)

    def show(self, layers: frozenset[Layer]) -> None:
        """Show some layers; the picture of the ground shows those of maps itself."""
        for wall in self._walls:
            _set_visible(wall, Layer.FLOOR in layers)
        _set_visible(self._frontiers, Layer.FRONTIERS in layers)
        for nodes in self._robots:
            for layer, node in nodes.layers:
                _set_visible(node, layer in layers)


def _set_visible(node: Any, is_visible: bool) -> None:  # noqa: ANN401
    if node.visible != is_visible:
        node.visible = is_visible


def _look_at(server: "ViserServer", middle: NDArray[np.float64], width: float, tall: float) -> None:
    """Let browsers begin above the floor, a little to the south of it; the panel at the right hides none."""
    camera = server.initial_camera
    away = max(0.53 * width, 0.83 * tall) / math.tan(0.5 * FIELD_OF_VIEW)
    aim = middle + np.array([PANEL_SHARE * away, 0.0, 0.0])
    camera.fov, camera.near = FIELD_OF_VIEW, 0.1
    camera.look_at = aim
    camera.position = aim + away * np.array([0.0, -0.35, 0.94])
