"""The scene of a live view: floor, maps, and of each robot its body, poses, scan, path, plan and maps."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from lidarium.envs.drawing.frame_parts import DOOR, EXPLORED, PERSON, UNEXPLORED, Colour, Frame, team_colours, thinned
from lidarium.envs.drawing.prediction_layer import STRENGTH, PredictionLayer, tinted
from lidarium.envs.drawing.shading import owner_colours
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.floors.faces import GROUND, section_of
from lidarium.envs.floors.floor import Floor
from lidarium.envs.settings.robots import Robot
from lidarium.envs.simulation.kernels.arrays import LEAF_HEIGHT_M, PERSON_HEIGHT_M
from lidarium.envs.simulation.people.crowd import Crowd
from lidarium.evaluation.drawing.joined_maps import overlaid, shades_of
from lidarium.evaluation.report.map_layers import FREE, OCCUPIED, UNKNOWN, coarse, grid_around
from lidarium.evaluation.truth.beliefs import map_within
from lidarium.evaluation.truth.true_map import truth_of
from lidarium.evaluation.viewing.controls import Layer
from lidarium.evaluation.viewing.moment import Moment, RobotMoment, body_rotation

if TYPE_CHECKING:
    from viser import SceneApi, ViserServer


SIDES = 28
"""Sides of a body that is drawn as a prism."""

_BOX = np.array([[0, 1, 3], [0, 3, 2], [4, 7, 5], [4, 6, 7], [0, 4, 1], [1, 4, 5]])
_BOX_SIDES = np.concatenate([_BOX, [[2, 3, 7], [2, 7, 6], [0, 2, 4], [2, 6, 4], [1, 5, 3], [3, 5, 7]]])


_ENDS = (slice(0, 2), slice(2, 4))


class _Mesh(NamedTuple):
    """Triangles.

    Attributes
    ----------
    vertices : (V, 3) float32
        x, y, z [m].
    triangles : (T, 3) uint32
        Places of their corners in ``vertices``, counter-clockwise seen from the outside.
    """

    vertices: NDArray[np.float32]
    triangles: NDArray[np.uint32]


def floor_meshes(floor: Floor, height: float) -> dict[Colour, _Mesh]:
    """Return the obstacles of a floor, cut at a height [m], by colour; the ground is left out."""
    faces = section_of(floor, height)
    is_wall = np.array([floor.is_wall(solid) for solid in floor.solids], np.bool_)
    colours = np.rint(owner_colours(faces, is_wall)).astype(np.int64)
    stands = np.flatnonzero(faces.owners != GROUND)
    if not len(stands):
        return {}
    unique, members = np.unique(colours[stands], axis=0, return_inverse=True)
    return {
        (int(red), int(green), int(blue)): _of_quads(faces.corners[stands[members.ravel() == number]])
        for number, (red, green, blue) in enumerate(unique)
    }


def _of_quads(corners: NDArray[np.float64]) -> _Mesh:
    """Return the triangles of faces of four corners (F, 4, 3), of which triangles repeat one."""
    vertices = corners.reshape(-1, 3).astype(np.float32)
    firsts = 4 * np.arange(len(corners))[:, None]
    triangles = np.concatenate([firsts + np.array(half) for half in ((0, 1, 2), (0, 2, 3))])
    a, b, c = (vertices[triangles[:, corner]] for corner in range(3))
    has_area = np.linalg.norm(np.cross(b - a, c - a), axis=1) > 0.0
    return _Mesh(vertices, triangles[has_area].astype(np.uint32))


def body_mesh(radius: float, height: float) -> _Mesh:
    """Return a round body on the ground, its middle at the origin."""
    around = _circle(radius)[:-1]
    low, high = (np.column_stack([around, np.full(SIDES, z)]) for z in (0.0, height))
    k = np.arange(SIDES)
    beside = (k + 1) % SIDES
    sides = np.concatenate(
        [np.column_stack([k, beside, beside + SIDES]), np.column_stack([k, beside + SIDES, k + SIDES])]
    )
    top = np.column_stack([k + SIDES, beside + SIDES, np.full(SIDES, 2 * SIDES)])
    vertices = np.concatenate([low, high, [(0.0, 0.0, height)]])
    return _Mesh(vertices.astype(np.float32), np.concatenate([sides, top]).astype(np.uint32))


def _nose_mesh(radius: float, height: float) -> _Mesh:
    """Return an arrow ahead, on top of a body."""
    z = height + 0.012
    corners = [(0.85, 0.0), (-0.5, 0.5), (-0.25, 0.0), (-0.5, -0.5)]
    vertices = np.array([(radius * x, radius * y, z) for x, y in corners], np.float32)
    return _Mesh(vertices, np.array([(0, 1, 2), (0, 2, 3)], np.uint32))


def _circle(radius: float) -> NDArray[np.float64]:
    """Return points on a _circle about the origin, (SIDES + 1, 2), the last of them the first."""
    angles = 2.0 * math.pi * np.arange(SIDES + 1) / SIDES
    return radius * np.column_stack([np.cos(angles), np.sin(angles)])


def fan_mesh(laser: NDArray[np.float64], ends: NDArray[np.float64]) -> _Mesh:
    """Return the area of a scan: triangles from a laser (3,) to the ends of two beams (beams, 3) each [m]."""
    k = np.arange(1, len(ends))
    triangles = np.column_stack([np.zeros_like(k), k, k + 1]).astype(np.uint32)
    return _Mesh(np.concatenate([laser[None], ends]).astype(np.float32), triangles)


def boxes_mesh(boxes: NDArray[np.float64]) -> _Mesh:
    """Return boxes of low and high corners (B, 2, 3) [m]."""
    chosen = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
    vertices = boxes[:, chosen, np.arange(3)].reshape(-1, 3)
    triangles = 8 * np.arange(len(boxes))[:, None, None] + _BOX_SIDES
    return _Mesh(vertices.astype(np.float32), triangles.reshape(-1, 3).astype(np.uint32))


def _leaves_mesh(leaves: NDArray[np.float64], height: float) -> _Mesh:
    """Return upright leaves of doors with ends x, y, x, y (L, 4) [m]."""
    corners = [np.column_stack([leaves[:, end], np.full(len(leaves), z)]) for z in (0.0, height) for end in _ENDS]
    vertices = np.stack(corners, axis=1).reshape(-1, 3).astype(np.float32)
    firsts = 4 * np.arange(len(leaves))[:, None]
    triangles = np.concatenate([firsts + np.array(half) for half in ((0, 1, 3), (0, 3, 2))])
    return _Mesh(vertices, triangles.astype(np.uint32))


def segments(points: NDArray[np.float64], height: float) -> NDArray[np.float32]:
    """Return the pieces of a path (P, 2) at a height, (P - 1, 2, 3); empty for fewer than two points."""
    if len(points) < 2:
        return np.zeros((0, 2, 3), np.float32)
    lifted = np.column_stack([points, np.full(len(points), height)]).astype(np.float32)
    return np.stack([lifted[:-1], lifted[1:]], axis=1)


LEAST_FRONTIER_M = 0.3
"""Frontiers shorter than this are left out [m]."""

Levels = NDArray[np.int8]


class TeamMaps:
    """The maps of a team on a common grid, and how a page shows them.

    Attributes
    ----------
    cell_m : float
        Side of a cell [m].
    corner : (x, y)
        Lower left corner of the grid in the floor's frame [m].
    size : (width, height)
        Size of the grid [m].
    """

    def __init__(self, env: ExplorationEnv) -> None:
        resolution, tables = env.settings.occupancy.resolution, env.world.floors[0]
        assert tables is not None
        self._grid = grid = grid_around(truth_of(env).knowable, resolution)
        self._colours: list[Colour] = team_colours(env.settings.robots)
        self.cell_m = grid.block * resolution
        x, y = tables.laser.origin
        self.corner = (x + grid.column * resolution, y + grid.row * resolution)
        self.size = (grid.columns * self.cell_m, grid.rows * self.cell_m)
        self._prediction = PredictionLayer()

    def levels(self, env: ExplorationEnv, groups: Sequence[set[int]]) -> list[Levels]:
        """Return the map of each group of robots, (rows, columns): above 0 occupied, below 0 free."""
        return [self._coarse(self._sum(env, group)) for group in groups]

    def free_beyond(self, env: ExplorationEnv, groups: Sequence[set[int]]) -> NDArray[np.float32]:
        """Return the probability that cells that no group knows are free, by the maps of all, (rows, columns)."""
        log_odds = self._sum(env, set().union(*groups))
        grid, free = self._grid, self._prediction.cells(log_odds, env.settings.occupancy.resolution)
        return thinned(free, grid.block)[: grid.rows, : grid.columns]

    def _sum(self, env: ExplorationEnv, group: set[int]) -> NDArray[np.int16]:
        """Return the sum of the maps of some robots, in cells of the lattice."""
        window = self._grid.window
        sides = [side.stop - side.start for side in window]
        together = np.zeros(sides, np.int16)
        for robot in sorted(group):
            together += map_within(env, robot, *window)
        return together

    def _coarse(self, log_odds: NDArray[np.signedinteger[Any]]) -> Levels:
        classes = coarse(np.asarray(log_odds > 0), np.asarray(log_odds < 0), self._grid.block)
        signs = np.zeros(3, np.int8)
        signs[[UNKNOWN, FREE, OCCUPIED]] = 0, -1, 1
        return signs[classes]

    def picture(
        self, groups: Sequence[set[int]], maps: Sequence[Levels], free: NDArray[np.float32] | None = None
    ) -> Frame:
        """Return a picture of the ground with the maps of groups over it, upright.

        Maps of single robots are in their colours, joined maps in white and dark; beyond them it is the bluer the more
        probably it is free, if that is given.
        """
        blank = np.full((self._grid.rows, self._grid.columns, 3), UNEXPLORED, np.uint8)
        if free is not None:
            blank = tinted(blank, STRENGTH * free)
        picture = overlaid(blank, maps, [shades_of(group, self._colours) for group in groups])
        return np.ascontiguousarray(picture[::-1])

    def frontiers(self, maps: Sequence[Levels]) -> NDArray[np.float64]:
        """Return the middles of free cells next to unknown ones, of any of the maps, (N, 2) [m]."""
        found = [self._frontier(levels) for levels in maps]
        if not found:
            return np.zeros((0, 2))
        rows, columns = np.nonzero(np.any(found, axis=0))
        places = np.column_stack([columns, rows]).astype(np.float64) + 0.5
        return np.array(self.corner) + self.cell_m * places

    def _frontier(self, levels: Levels) -> NDArray[np.bool_]:
        cross = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))
        beside_unknown = cv2.dilate((levels == 0).view(np.uint8), cross) != 0
        frontier = (beside_unknown & (levels < 0)).view(np.uint8)
        _, labels, measures, _ = cv2.connectedComponentsWithStats(frontier, connectivity=8)
        is_long = measures[:, cv2.CC_STAT_AREA] * self.cell_m >= LEAST_FRONTIER_M
        is_long[0] = False
        return np.asarray(is_long[labels])


TRAIL_HEIGHT, PLAN_HEIGHT, GOAL_HEIGHT, BELIEVED_HEIGHT = 0.02, 0.05, 0.06, 0.07
LINE = 0.035
"""Thickness of lines [m]."""

_NOWHERE = np.zeros((0, 2, 3), np.float32)


class RobotNodes:
    """The nodes of a robot in a scene.

    Attributes
    ----------
    layers : list of (Layer, node)
        Nodes by layer.
    """

    def __init__(self, scene: "SceneApi", agent: str, colour: Colour, robot: Robot) -> None:
        self._scene, self._agent, self._colour = scene, agent, colour
        root = f"/robots/{agent}"
        self._body = scene.add_frame(root, show_axes=False)
        for name, mesh, shade in (
            ("trunk", body_mesh(robot.radius, robot.height), colour),
            ("nose", _nose_mesh(robot.radius, robot.height), EXPLORED),
        ):
            scene.add_mesh_simple(f"{root}/{name}", mesh.vertices, mesh.triangles, color=shade, side="double")
        scene.add_label(f"{root}/name", agent, position=(0.0, 0.0, robot.height + 0.25), anchor="bottom-center")
        # In the floor's frame: a slow browser shows an old scan at its own pose, not turned with the body.
        self._scans = scene.add_frame(f"/scans/{agent}", show_axes=False)
        self._scan = scene.add_frame(f"/scans/{agent}/last", show_axes=False)
        self._hits = self._points(f"/scans/{agent}/last/hits", colour, 0.035)
        self._cloud = self._points(f"/clouds/{agent}", colour, 0.02)
        outline = segments(_circle(1.3 * robot.radius), BELIEVED_HEIGHT)
        ahead = segments(robot.radius * np.array([(1.0, 0.0), (1.9, 0.0)]), BELIEVED_HEIGHT)
        self._believed = self._lines(f"/believed/{agent}", np.concatenate([outline, ahead]), LINE)
        self._trail = self._lines(f"/trails/{agent}", _NOWHERE, LINE)
        self._plans = scene.add_frame(f"/plans/{agent}", show_axes=False)
        self._plan = self._lines(f"/plans/{agent}/path", _NOWHERE, 0.7 * LINE)
        goal = np.concatenate([segments(_circle(share * robot.radius), GOAL_HEIGHT) for share in (0.3, 0.9)])
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
        self._trail.points = segments(robot.trail, TRAIL_HEIGHT)
        self._plan.points = segments(robot.plan, PLAN_HEIGHT)
        self._goal.visible = robot.goal is not None
        if robot.goal is not None:
            self._goal.position = (*robot.goal, 0.0)
        self._cloud.points = robot.cloud
        self._draw_boxes(robot)

    def _draw_scan(self, robot: RobotMoment) -> None:
        self._scan.visible = not robot.has_ended
        self._hits.points = robot.ends[robot.is_hit].astype(np.float32)
        fan = fan_mesh(robot.laser, robot.ends)
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
        mesh = boxes_mesh(robot.boxes)
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


FRONTIER: Colour = (219, 39, 119)
FRONTIER_HEIGHT = 0.03
FIELD_OF_VIEW = math.radians(50.0)
"""Upright angle that a browser sees at first [rad]."""

PANEL_SHARE = 0.13
"""Distance to the right of the floor at which the camera looks at first, as a share of its own distance."""

BACKGROUND: Colour = (246, 247, 249)


class TeamScene:
    """The drawing of a run."""

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
        self._people: list[Any] = []
        self._doors: Any = None
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
            for number, (colour, mesh) in enumerate(floor_meshes(self._floor, height).items())
        ]

    def draw_ground(self, picture: Frame, frontiers: NDArray[np.float64]) -> None:
        """Show the maps as a picture, and the frontiers (N, 2) [m]."""
        self._ground.image = picture
        lifted = np.column_stack([frontiers, np.full(len(frontiers), FRONTIER_HEIGHT)])
        self._frontiers.points = lifted.astype(np.float32)

    def draw(self, moment: Moment) -> None:
        """Show robots, their scans and plans."""
        for nodes, robot in zip(self._robots, moment.robots, strict=True):
            nodes.draw(robot)
        if moment.crowd is not None:
            self._draw_crowd(moment.crowd)

    def _draw_crowd(self, crowd: Crowd) -> None:
        """Show people as upright cylinders, and doors as leaves."""
        for number, radius in enumerate(crowd.people[len(self._people) :, 2], len(self._people)):
            mesh = body_mesh(float(radius), PERSON_HEIGHT_M)
            name = f"/people/person_{number}"
            self._people.append(self._scene.add_mesh_simple(name, mesh.vertices, mesh.triangles, color=PERSON))
        for node, (x, y, _) in zip(self._people, crowd.people, strict=True):
            node.position = (x, y, 0.0)
        leaves = _leaves_mesh(crowd.leaves[crowd.opened < 1.0], LEAF_HEIGHT_M)
        if self._doors is None:
            self._doors = self._scene.add_mesh_simple(
                "/doors", leaves.vertices, leaves.triangles, color=DOOR, flat_shading=True, side="double"
            )
        elif len(leaves.vertices) == len(self._doors.vertices):
            self._doors.vertices = leaves.vertices
        else:
            self._doors.remove()
            self._doors = None
            self._draw_crowd(crowd)

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
