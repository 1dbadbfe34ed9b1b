"""What a page draws of a run: floor, ground, frontiers and robots, as far as their layers are shown."""

import math
from dataclasses import replace

import numpy as np
import pytest
from linked_rooms import TWO_ROOMS
from recorded_scene import RecordedServer

from lidarium.envs.floors.floor import Solid
from lidarium.envs.settings.making import make_settings
from lidarium.evaluation.episodes.watching import WatchedExploration
from lidarium.evaluation.viewing.controls import Layer
from lidarium.evaluation.viewing.maps import TeamMaps
from lidarium.evaluation.viewing.moment import moment_of
from lidarium.evaluation.viewing.scene import FIELD_OF_VIEW, FRONTIER_HEIGHT, TeamScene


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
