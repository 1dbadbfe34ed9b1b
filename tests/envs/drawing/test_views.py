"""Pictures in three dimensions show what stands where."""

import numpy as np
import pytest

from lidarium.envs.drawing.frame_parts import INK, team_colours
from lidarium.envs.drawing.views import FloorViews, camera_panel, false_colours
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.floors.faces import SECTION, section_of
from lidarium.envs.floors.floor import Floor, Solid
from lidarium.envs.floors.raster import Raster
from lidarium.envs.settings.cameras import CAMERAS
from lidarium.envs.settings.making import make_settings

BOX = Solid(np.array([(2.0, 2.0), (3.0, 2.0), (3.0, 3.0), (2.0, 3.0)]), 0.0, 0.8)
WALL = Solid(np.array([(0.0, 0.0), (4.0, 0.0), (4.0, 0.2), (0.0, 0.2)]))
ROOM = Floor("room", (0.0, 0.0, 4.0, 4.0), (WALL, BOX))
POSES = np.array([[1.0, 2.5, 0.0], [1.0, 1.0, 1.0]])


def views():
    return FloorViews(ROOM, 0.18, 0.52, team_colours(2))


def colours_of(picture):
    return {tuple(colour) for colour in picture.reshape(-1, 3).tolist()}


def test_walls_are_cut_and_furniture_is_whole_seen_from_above():
    section = section_of(ROOM, 1.3)
    assert section.corners[:, :, 2].max() == 1.3
    assert (section.owners == SECTION).sum() == 1  # the wall's; the box ends below
    assert (section.corners[section.owners == 1][:, :, 2].max()) == 0.8


def test_the_section_of_an_image_covers_its_solid_cells():
    solid = np.random.default_rng(0).integers(0, 2, (12, 9)).astype(np.uint8)
    section = section_of(Floor("image", (0.0, 0.0, 0.9, 1.2), cells=Raster(solid, (0.0, 0.0), 0.1)), 1.0)
    tops = section.corners[section.owners == SECTION]
    sides = np.ptp(tops[:, :, :2], axis=1)
    assert sides.prod(axis=1).sum() == pytest.approx(0.01 * solid.sum())


def test_a_robot_is_where_it_stands_in_each_picture():
    blue, orange = team_colours(2)
    above = views().from_above(POSES, (300, 400))
    rows, columns = np.nonzero((above == blue).all(axis=2))
    other_rows, _ = np.nonzero((above == orange).all(axis=2))
    assert len(rows) > 20
    assert rows.mean() < other_rows.mean()  # farther up in the picture: at a greater y
    behind = views().from_behind(POSES, 0, (240, 320))
    _, columns = np.nonzero((behind == blue).all(axis=2))
    assert columns.mean() == pytest.approx(159.5, abs=2.0)
    own = views().of_camera(POSES, np.zeros((2, 3)), 0, CAMERAS["xtion"], (240, 320))
    assert blue not in colours_of(own)


def test_the_picture_of_a_camera_agrees_with_its_depth_image():
    camera = CAMERAS["xtion"]
    depth = views().depth(POSES, np.zeros((2, 3)), 0, camera)
    picture = views().of_camera(POSES, np.zeros((2, 3)), 0, camera, (240, 320))
    box = np.isclose(depth, 1.0, atol=1e-4)
    assert box.sum() > 5000
    # All of the box's front has one colour, but for its border.
    found, counts = np.unique(picture[box], axis=0, return_counts=True)
    assert counts.max() > 0.95 * box.sum()
    assert len(found) <= 4


def test_no_measurement_is_dark_in_false_colours():
    depth = np.array([[0.0, 0.5], [3.9, 2.0]], np.float32)
    picture = false_colours(depth, CAMERAS["xtion"], (2, 2))
    assert tuple(picture[0, 0]) == INK
    assert picture[0, 1, 0] > picture[1, 0, 0]  # near is warm


@pytest.mark.parametrize("height", [301, 720])
def test_a_panel_has_the_height_of_its_frame(height):
    camera = CAMERAS["xtion"]
    depth = views().depth(POSES, np.zeros((2, 3)), 0, camera)
    panel = camera_panel(views(), POSES, np.zeros((2, 3)), depth, camera, height)
    assert panel.shape[0] == height
    assert panel.shape[1] % 2 == 0


def test_frames_of_robots_with_cameras_are_wider():
    sizes = {}
    for camera in (None, "depth_64x48"):
        env = ExplorationEnv("apartment", make_settings(camera=camera), render_mode="rgb_array")
        env.reset(seed=0)
        frame = env.render()
        sizes[camera] = frame.shape
        assert frame.shape[1] % 2 == 0
    assert sizes["depth_64x48"][0] == sizes[None][0]
    assert sizes["depth_64x48"][1] > sizes[None][1]
