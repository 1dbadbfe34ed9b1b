"""Maps that are drawn over each other show whose they are."""

import numpy as np

from lidarium.envs.drawing.frame_parts import EXPLORED, WALL, pale, team_colours
from lidarium.evaluation.drawing.joined_maps import overlaid, shades_of


def test_where_two_maps_meet_their_colours_are_mixed():
    blank = np.zeros((1, 3, 3), np.uint8)
    maps = [np.array([[-1, -1, 0]], np.int8), np.array([[0, -1, 0]], np.int8)]
    shades = [((0, 0, 0), (200, 0, 0)), ((0, 0, 0), (0, 100, 0))]
    assert overlaid(blank, maps, shades).tolist() == [[[200, 0, 0], [100, 50, 0], [0, 0, 0]]]


def test_joined_robots_have_one_shade():
    assert shades_of({0, 1}, team_colours(2)) == (WALL, EXPLORED)
    _, orange = team_colours(2)
    assert shades_of({1}, team_colours(2)) == (orange, pale(orange))
