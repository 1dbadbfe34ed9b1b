import math

import cv2
import numpy as np
import pytest

from lidarium.envs.floors.importers import load_file

MARGIN = 7


def hall(tmp_path, model='size [6.0 4.0 0.8] pose [1 2 0 0] bitmap "hall.png"', rest=""):
    """A picture of a hall of 120 x 80 pixels with a wall in it, in a white margin, and its world."""
    pixels = np.full((80 + 2 * MARGIN, 120 + 2 * MARGIN), 255, np.uint8)
    pixels[MARGIN:-MARGIN, MARGIN:-MARGIN] = 0
    pixels[MARGIN + 2 : -MARGIN - 2, MARGIN + 2 : -MARGIN - 2] = 255
    pixels[MARGIN : MARGIN + 40, MARGIN + 30 : MARGIN + 32] = 0
    cv2.imwrite(str(tmp_path / "hall.png"), pixels)
    (tmp_path / "bots.inc").write_text("define bot position ( size [0.3 0.3 0.4] block ( points 1 point[0] [0 0 1] ) )")
    (tmp_path / "hall.world").write_text(
        f'# a hall\ninclude "bots.inc"\nwindow ( size [ 640 480 ] )\ndefine plan model ( boundary 1 )\n'
        f'plan ( name "a (b)" {model} )\nbot ( pose [ 0 1 0 90 ] )\n{rest}'
    )
    return tmp_path / "hall.world"


def is_free(floor, x, y):
    cells = floor.raster(0.05, 0.3, 0.3)
    return cells.solid[math.floor((y - cells.origin[1]) / 0.05), math.floor((x - cells.origin[0]) / 0.05)] == 0


def test_a_world_is_its_picture_trimmed_scaled_and_placed(tmp_path):
    floor = load_file(hall(tmp_path))
    assert floor.bounds == pytest.approx((-1.9, 0.1, 3.9, 3.9))
    assert floor.starts == pytest.approx(np.array([[0.0, 1.0, math.pi / 2]]))
    # The wall is in the upper half of the picture, 1.5 m from the left.
    assert not is_free(floor, -0.47, 3.0)
    assert is_free(floor, -0.47, 1.0)


def test_a_turned_world_is_turned_about_its_middle(tmp_path):
    floor = load_file(hall(tmp_path, 'size [6 4] pose [1 2 90] bitmap "hall.png"'))
    assert floor.bounds == pytest.approx((-0.9, -0.9, 2.9, 4.9), abs=0.05)
    assert not is_free(floor, 0.0, 0.53)
    assert is_free(floor, 2.0, 0.53)


def test_pixels_need_not_be_square(tmp_path):
    floor = load_file(hall(tmp_path, 'size [6 8 1] pose [3 4 0 0] bitmap "/elsewhere/hall.png"'))
    assert floor.bounds == pytest.approx((0.1, 0.2, 5.9, 7.8))


@pytest.mark.parametrize(
    ("model", "rest", "message"),
    [
        ('bitmap "hall.png"', "", "has the size ''; want 2 or 3 numbers"),
        ('size [6 nan] bitmap "hall.png"', "", "want 2 or 3 numbers"),
        ("size [6 4 1]", "", "0 models of a bitmap"),
        ('size [6 4] bitmap "hall.png"', "bot ( pose [ 1", "ends within"),
        ('size [6 4] bitmap "hall.png"', 'include "hall.world"', "more than 16 deep"),
    ],
)
def test_what_cannot_be_read_is_refused_by_name(tmp_path, model, rest, message):
    with pytest.raises(ValueError, match=message):
        load_file(hall(tmp_path, model, rest))


def test_a_world_of_another_program_has_its_area_and_start(shared_cases):
    floor = load_file(shared_cases / "stage-world" / "hall.world")
    assert float((floor.cells.solid == 0).sum()) * floor.cells.resolution**2 == pytest.approx(94.9, abs=0.01)
    assert floor.cells.resolution == pytest.approx(0.05)
    assert floor.starts == pytest.approx(np.array([[-4.0, 2.0, math.pi / 2]]))


def test_an_endless_name_of_the_picture_is_refused(tmp_path):
    text = f'plan ( size [6 4 1] pose [0 0 0 0] bitmap "{"a" * 5000}.png" )\n'
    (tmp_path / "a.world").write_text(text)
    with pytest.raises(FileNotFoundError, match="its name is too long"):
        load_file(tmp_path / "a.world")


@pytest.mark.parametrize(("colour", "is_wall"), [((255, 0, 0), True), ((0, 0, 255), False)])
def test_a_coloured_wall_is_one_if_it_has_no_red(tmp_path, colour, is_wall):
    path = hall(tmp_path)
    pixels = cv2.cvtColor(cv2.imread(str(tmp_path / "hall.png"), cv2.IMREAD_GRAYSCALE), cv2.COLOR_GRAY2BGR)
    pixels[MARGIN + 2 : MARGIN + 78, MARGIN + 60 : MARGIN + 62] = colour
    cv2.imwrite(str(tmp_path / "hall.png"), pixels)
    assert is_free(load_file(path), 1.03, 1.0) == (not is_wall)
