"""Parts of frames, drawn from plain arrays."""

import numpy as np
import pytest

from lidarium.envs.drawing.frame_parts import (
    LEAST_WIDTH,
    SHIFT,
    UNEXPLORED,
    blocks_of,
    draw_bar,
    draw_robots,
    enlarged,
    even,
    line_of_text,
    pale,
    team_colours,
    view_around,
    with_header,
)


def test_all_robots_of_the_largest_team_have_colours_of_their_own():
    colours = team_colours(64)
    assert len(set(colours)) == 64
    assert colours[:3] == team_colours(3)
    assert all(0 <= channel <= 255 for colour in colours for channel in colour)


def test_a_view_is_around_what_is_shown_with_a_margin():
    shown = np.zeros((100, 200), bool)
    shown[40:60, 50:150] = True
    view = view_around(shown, (1.0, 2.0), 0.05, 440)
    assert (view.rows, view.columns) == (slice(35, 65), slice(45, 155))
    assert view.origin == pytest.approx((1.0 + 45 * 0.05, 2.0 + 35 * 0.05))
    assert (view.height, view.width, view.block) == (120, 440, 1)
    assert view_around(shown, (0.0, 0.0), 0.05, 50).block == 2


def test_points_lie_in_the_pixel_that_shows_them():
    view = view_around(np.ones((10, 20), bool), (1.0, 2.0), 0.1, 200)
    corner, opposite = view.pixels(np.array([(1.05, 2.05), (2.95, 2.95)])) / (1 << SHIFT)
    assert corner == pytest.approx((4.5, 94.5))
    assert opposite == pytest.approx((194.5, 4.5))


def test_occupied_cells_show_in_blocks():
    levels = np.full((5, 6), 255, np.uint8)
    levels[3, 1], levels[4] = 0, 0
    view = view_around(np.ones((5, 6), bool), (0.0, 0.0), 1.0, 3)
    assert view.block == 2
    assert blocks_of(levels, view).tolist() == [[255, 255, 255], [0, 255, 255]]


def test_a_picture_is_upright():
    view = view_around(np.ones((2, 2), bool), (0.0, 0.0), 1.0, 4)
    picture = np.zeros((2, 2, 3), np.uint8)
    picture[0] = 200  # the lowest y
    large = enlarged(picture, view)
    assert large[:2].max() == 0
    assert large[2:].min() == 200


def test_a_robot_that_has_ended_is_paler():
    view = view_around(np.ones((20, 20), bool), (0.0, 0.0), 0.1, 200)
    frames = []
    for has_ended in (False, True):
        frame = np.zeros((200, 200, 3), np.uint8)
        draw_robots(frame, view, np.array([(1.0, 1.0, 0.0)]), 0.3, [has_ended], [(200, 0, 0)])
        frames.append(frame)
        assert frame[:, :60].max() == frame[:60].max() == 0
    assert frames[0][99, 80].tolist() == [200, 0, 0]
    assert frames[1][99, 80].tolist() == [210, 110, 110]
    assert pale((255, 255, 255)) == (255, 255, 255)


@pytest.mark.parametrize("share", [0.0, 0.25, 1.0, 1.5])
def test_a_bar_is_as_long_as_the_share(share):
    line = np.zeros((2, 80, 3), np.uint8)
    draw_bar(line, share)
    assert (line[0] != UNEXPLORED).any(axis=1).sum() == 80 * min(share, 1.0)


def test_words_that_are_too_long_are_cut_and_frames_have_even_sides():
    line = line_of_text("words " * 50, (120, 24), (0, 0, 0), (255, 255, 255), right="end")
    assert line.shape == (24, 120, 3)
    assert (line[:, -6:] == 255).all()
    assert even(np.zeros((3, 5, 3), np.uint8)).shape == (4, 6, 3)
    framed = with_header(np.zeros((31, 33, 3), np.uint8), "B\u00fcro " * 30, 0.5, 12.0)
    assert framed.shape[1] == LEAST_WIDTH
    assert framed.shape[0] % 2 == 0
