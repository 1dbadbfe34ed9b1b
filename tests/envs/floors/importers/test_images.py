"""Pictures as floors."""

import cv2
import numpy as np
import pytest
from imported_floors import free_of, room

from lidarium.envs.floors.importers import load_file


def test_a_plain_image_needs_a_resolution(tmp_path):
    pixels = room()
    pixels[pixels == 205] = 100
    cv2.imwrite(str(tmp_path / "plan.png"), pixels)
    with pytest.raises(ValueError, match="--resolution"):
        load_file(tmp_path / "plan.png")
    assert free_of(load_file(tmp_path / "plan.png", 0.1), 0.1).sum() == 18 * 28 - 25 - 4


def test_in_a_picture_with_the_greys_of_map_server_unknown_is_solid(tmp_path):
    cv2.imwrite(str(tmp_path / "plan.png"), room())
    assert free_of(load_file(tmp_path / "plan.png", 0.1), 0.1).sum() == 18 * 28 - 25 - 4


@pytest.mark.parametrize("grey", [0, 90, 255])
def test_an_image_of_one_colour_is_refused(tmp_path, grey):
    cv2.imwrite(str(tmp_path / "plain.png"), np.full((20, 20), grey, np.uint8))
    with pytest.raises(ValueError, match=r"all free|all solid"):
        load_file(tmp_path / "plain.png", 0.1)


@pytest.mark.parametrize("coloured", [True, False])
def test_a_dungeon_starts_at_its_mark_and_only_what_can_be_reached_is_free(tmp_path, coloured):
    pixels = np.full((48, 64, 3), 127, np.uint8)
    pixels[4:20, 4:60] = pixels[30:40, 4:12] = 195
    pixels[32:36, 6:10] = (0, 216, 255) if coloured else 208
    cv2.imwrite(str(tmp_path / "level.png"), pixels if coloured else pixels[..., 0])
    floor = load_file(tmp_path / "level.png")
    np.testing.assert_allclose(floor.starts, [[0.8, 1.4, 0.0]])
    assert free_of(floor, 0.1).sum() == 80


def test_every_dungeon_has_a_start_in_free_space(shared_data):
    for path in sorted((shared_data / "floorplans" / "synthetic_dungeon").glob("*.png")):
        floor = load_file(path)
        raster = floor.raster(0.1, 0.0, 1.0)
        (x, y, _) = floor.starts[0]
        assert raster.solid[int((y - raster.origin[1]) / 0.1), int((x - raster.origin[0]) / 0.1)] == 0
        assert 500.0 < (raster.solid == 0).sum() * 0.01 < 1000.0


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_a_transparent_ground_is_white(dtype, tmp_path):
    walls = np.zeros((60, 80), bool)
    walls[:3] = walls[-3:] = walls[:, :3] = walls[:, -3:] = walls[25:28, :40] = True
    opaque = walls.copy()
    table = (slice(40, 50), slice(10, 30))
    opaque[table] = True
    most, colour = np.iinfo(dtype).max, np.zeros((60, 80), dtype)
    colour[table] = most
    drawn = cv2.merge([colour, colour, colour, (opaque * most).astype(dtype)])
    cv2.imwrite(str(tmp_path / "drawn.png"), drawn)
    cv2.imwrite(str(tmp_path / "plain.png"), np.where(walls, 0, most).astype(dtype))
    drawn, plain = (free_of(load_file(tmp_path / f"{name}.png", 0.1), 0.1) for name in ("drawn", "plain"))
    np.testing.assert_array_equal(drawn, plain)
