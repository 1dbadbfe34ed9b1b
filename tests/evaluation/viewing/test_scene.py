"""The scene of a live view."""

import math
from dataclasses import replace

import cv2
import numpy as np
import pytest
from linked_rooms import TWO_ROOMS
from recorded_scene import RecordedServer
from scipy.spatial.transform import Rotation

import lidarium
from lidarium.envs.drawing.frame_parts import EXPLORED, UNEXPLORED, WALL, pale, team_colours
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.floors.catalogue.names import load_floor
from lidarium.envs.floors.floor import Solid
from lidarium.envs.settings.making import make_settings
from lidarium.envs.settings.robots import ROBOTS
from lidarium.envs.simulation.kernels.arrays import LEAF_HEIGHT_M
from lidarium.envs.simulation.people.crowd import Crowd
from lidarium.evaluation.episodes.runner import run_episode
from lidarium.evaluation.episodes.watching import WatchedExploration
from lidarium.evaluation.truth.true_map import truth_of
from lidarium.evaluation.viewing.controls import OF_MAPS, Layer
from lidarium.evaluation.viewing.moment import NO_BOXES, NO_CLOUD, NO_POINTS, RobotMoment, moment_of
from lidarium.evaluation.viewing.scene import (
    FIELD_OF_VIEW,
    FRONTIER_HEIGHT,
    PLAN_HEIGHT,
    TRAIL_HEIGHT,
    RobotNodes,
    TeamMaps,
    TeamScene,
    body_mesh,
    boxes_mesh,
    fan_mesh,
    floor_meshes,
    segments,
)


@pytest.fixture
def env():
    made = WatchedExploration(TWO_ROOMS, make_settings(robots=2, resolution=0.05))
    made.reset(seed=0)
    return made


@pytest.fixture
def shown(env):
    server, maps = RecordedServer(), TeamMaps(env)
    return TeamScene(server, env, maps), server, maps


def test_the_ground_covers_the_maps_and_shows_their_picture(shown):
    scene, server, maps = shown
    ground = server.scene.nodes["/ground"]
    _, width, height = ground.given
    assert (width, height) == maps.size
    assert ground.position[:2] == pytest.approx(np.array(maps.corner) + 0.5 * np.array(maps.size))
    picture = np.zeros((4, 8, 3), np.uint8)
    scene.draw_ground(picture, np.array([[1.0, 2.0], [3.0, 0.5]]))
    assert ground.image is picture
    points = server.scene.nodes["/frontiers"].points
    assert points == pytest.approx(np.array([[1.0, 2.0, FRONTIER_HEIGHT], [3.0, 0.5, FRONTIER_HEIGHT]]))


def walls_of(server):
    return {name: node for name, node in server.scene.nodes.items() if name.startswith("/floor/")}


def test_walls_are_cut_at_a_height_and_drawn_again_only_at_another(shown):
    scene, server, _ = shown
    assert walls_of(server) == {}
    scene.cut_walls(1.0)
    first = walls_of(server)
    assert max(np.asarray(wall.given[0])[:, 2].max() for wall in first.values()) == pytest.approx(1.0)
    scene.cut_walls(1.0)
    assert walls_of(server) == first
    assert all(walls_of(server)[name] is node for name, node in first.items())
    scene.cut_walls(0.4)
    second = walls_of(server)
    assert not set(map(id, first.values())) & set(map(id, second.values()))
    assert max(np.asarray(wall.given[0])[:, 2].max() for wall in second.values()) == pytest.approx(0.4)


def test_of_what_hangs_above_the_cut_nothing_is_left():
    board = Solid(np.array([[1.0, 3.0], [2.0, 3.0], [2.0, 3.4], [1.0, 3.4]]), 1.0, 1.2)
    env = WatchedExploration(replace(TWO_ROOMS, solids=(*TWO_ROOMS.solids, board)), make_settings(robots=1))
    env.reset(seed=0)
    server = RecordedServer()
    scene = TeamScene(server, env, TeamMaps(env))
    counts = []
    for height in (1.5, 0.5):
        scene.cut_walls(height)
        counts.append(len(walls_of(server)))
    # Walls and their cut tops, and the board.
    assert counts == [3, 2]


def test_each_robot_is_drawn_at_its_place(shown, env):
    scene, server, _ = shown
    scene.draw(moment_of(env))
    for row, agent in enumerate(env.possible_agents):
        assert server.scene.nodes[f"/robots/{agent}"].position[:2] == pytest.approx(TWO_ROOMS.starts[row, :2])


def test_people_are_cylinders_and_doors_leaves_that_slide(shown, env):
    scene, server, _ = shown
    ends = np.array([(1.0, 1.0, 2.0, 1.0), (3.0, 1.0, 3.0, 2.0)])

    def draw(x, *opened):
        crowd = Crowd(np.array([(x, 2.0, 0.25), (4.0, 3.0, 0.3)]), ends, np.array(opened))
        scene.draw(replace(moment_of(env), crowd=crowd))

    def leaves():
        return np.asarray(server.scene.nodes["/doors"].vertices)

    draw(1.0, 0.0, 0.25)
    assert leaves()[:, :2].max(axis=0) == pytest.approx((3.0, 1.75))
    draw(1.5, 0.5, 0.5)
    assert leaves().max(axis=0) == pytest.approx((3.0, 1.5, LEAF_HEIGHT_M))
    assert server.scene.nodes["/people/person_0"].position == pytest.approx((1.5, 2.0, 0.0))
    body = np.asarray(server.scene.nodes["/people/person_1"].vertices)
    assert np.hypot(*body[:, :2].T).max() == pytest.approx(0.3)
    for opened, count in ((0.5, 4), (1.0, 0), (0.5, 4)):
        draw(1.5, 1.0, opened)
        assert len(leaves()) == count


def test_layers_that_are_not_chosen_are_hidden(shown):
    scene, server, _ = shown
    scene.cut_walls(1.0)
    nodes, walls = server.scene.nodes, walls_of(server)
    scene.show(frozenset({Layer.SCANS, Layer.FLOOR}))
    assert all(wall.visible for wall in walls.values())
    assert nodes["/scans/robot_1"].visible
    assert not nodes["/frontiers"].visible
    assert not nodes["/robots/robot_0"].visible
    scene.show(frozenset({Layer.FRONTIERS, Layer.ROBOTS}))
    assert not any(wall.visible for wall in walls.values())
    assert not nodes["/scans/robot_1"].visible
    assert nodes["/frontiers"].visible
    assert nodes["/robots/robot_0"].visible


def test_browsers_see_the_whole_floor_at_first(shown):
    _, server, maps = shown
    camera, middle = server.initial_camera, np.array(maps.corner) + 0.5 * np.array(maps.size)
    away = camera.position - camera.look_at
    assert camera.fov == FIELD_OF_VIEW
    assert away[2] > 0.0
    assert away[1] < 0.0
    assert away[0] == 0.0
    # As the camera looks nearly straight down, half of the floor fits in half of what it sees.
    half_seen = np.linalg.norm(away) * math.tan(0.5 * FIELD_OF_VIEW)
    assert half_seen >= 0.5 * max(maps.size)
    assert camera.look_at[1] == pytest.approx(middle[1])
    assert middle[0] < camera.look_at[0] < middle[0] + 0.5 * maps.size[0]


def volume(mesh):
    """Volume that triangles enclose, by the theorem of Gauss."""
    a, b, c = (mesh.vertices[mesh.triangles[:, corner]].astype(np.float64) for corner in range(3))
    return np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0


def area(mesh):
    a, b, c = (mesh.vertices[mesh.triangles[:, corner]].astype(np.float64) for corner in range(3))
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()


def test_boxes_enclose_their_volume():
    boxes = np.array([[(0.0, 0.0, 0.0), (1.0, 2.0, 3.0)], [(5.0, 5.0, 5.0), (5.5, 6.0, 7.0)]])
    mesh = boxes_mesh(boxes)
    assert mesh.triangles.shape == (24, 3)
    assert np.isclose(volume(mesh), 6.0 + 1.0)


def test_no_boxes_are_no_triangles():
    mesh = boxes_mesh(np.zeros((0, 2, 3)))
    assert mesh.vertices.shape == mesh.triangles.shape == (0, 3)


def test_a_body_is_nearly_a_cylinder():
    mesh = body_mesh(0.2, 0.5)
    share = volume(mesh) / (np.pi * 0.2**2 * 0.5)
    assert 0.98 < share < 1.0
    assert mesh.vertices[:, 2].max() == 0.5


def test_a_fan_covers_what_lies_between_beams():
    angles = np.linspace(-np.pi / 2, np.pi / 2, 181)
    laser = np.array([3.0, 1.0, 0.3])
    ends = laser + 2.0 * np.column_stack([np.cos(angles), np.sin(angles), np.zeros(181)])
    assert np.isclose(area(fan_mesh(laser, ends)), np.pi * 2.0, rtol=1e-3)


def test_a_floor_is_cut_at_a_height_and_its_furniture_keeps_its_colours():
    floor = load_floor("open_apartment")
    low, high = (floor_meshes(floor, height) for height in (0.4, 1.3))
    for found, height in ((low, 0.4), (high, 1.3)):
        assert np.isclose(max(mesh.vertices[:, 2].max() for mesh in found.values()), height)
        assert min(mesh.vertices[:, 2].min() for mesh in found.values()) >= 0.0
        assert all(area(mesh) > 0.0 for mesh in found.values())
    assert len(high) > 3


def test_a_path_is_as_many_pieces_as_it_has_steps():
    pieces = segments(np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 2.0)]), 0.5)
    assert np.array_equal(pieces, [[(0, 0, 0.5), (1, 0, 0.5)], [(1, 0, 0.5), (1, 2, 0.5)]])
    assert segments(np.zeros((1, 2)), 0.5).shape == (0, 2, 3)


@pytest.fixture(scope="module")
def explored_env():
    settings = make_settings(robots=2, horizon_s=15.0, resolution=0.05, known_starts=False)
    env = ExplorationEnv("apartment", settings)
    run_episode(lidarium.policy("nearest_frontier_own_map"), env, 1)
    return env


def test_what_robots_hold_to_be_free_is_free_on_the_floor(explored_env):
    env = explored_env
    maps = TeamMaps(env)
    occupied = truth_of(env).occupied
    (x, y), (left, low) = maps.corner, env.world.floors[0].laser.origin
    row, column = round((y - low) / maps.cell_m), round((x - left) / maps.cell_m)
    for levels in maps.levels(env, [{0}, {1}]):
        true = occupied[row : row + levels.shape[0], column : column + levels.shape[1]]
        assert (levels < 0).sum() > 500
        assert (true & (levels < 0)).sum() < 0.02 * (levels < 0).sum()
        within_a_cell = cv2.dilate(true.view(np.uint8), np.ones((3, 3), np.uint8)) != 0
        assert (within_a_cell & (levels > 0)).sum() > 0.98 * (levels > 0).sum()


def test_a_joined_map_knows_what_its_robots_do(explored_env):
    env = explored_env
    maps = TeamMaps(env)
    one, other = maps.levels(env, [{0}, {1}])
    (both,) = maps.levels(env, [{0, 1}])
    assert ((both != 0) <= ((one != 0) | (other != 0))).all()
    assert (both < 0).sum() > max((one < 0).sum(), (other < 0).sum())


def test_frontiers_are_free_cells_beside_unknown_ones(explored_env):
    env = explored_env
    maps = TeamMaps(env)
    (levels,) = found = maps.levels(env, [{0, 1}])
    frontiers = maps.frontiers(found)
    assert len(frontiers) > 20
    for x, y in frontiers:
        row, column = int((y - maps.corner[1]) / maps.cell_m), int((x - maps.corner[0]) / maps.cell_m)
        assert levels[row, column] < 0
        around = (
            levels[max(row - 1, 0) : row + 2, column],
            levels[row, max(column - 1, 0) : column + 2],
        )
        assert any((side == 0).any() for side in around)
    assert maps.frontiers([]).shape == (0, 2)


def test_a_picture_shows_whose_map_it_is(explored_env):
    env = explored_env
    maps = TeamMaps(env)
    blue, orange = team_colours(2)

    def colours(groups):
        picture = maps.picture(groups, maps.levels(env, groups))
        return {tuple(colour) for colour in np.unique(picture.reshape(-1, 3), axis=0).tolist()}

    assert colours([]) == {UNEXPLORED}
    assert colours([{0, 1}]) == {UNEXPLORED, WALL, EXPLORED}
    assert colours([{0}]) == {UNEXPLORED, blue, pale(blue)}
    assert colours([{1}]) == {UNEXPLORED, orange, pale(orange)}


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
    assert set(Layer) - set(of_layers) == OF_MAPS | {Layer.FLOOR, Layer.FRONTIERS}
