"""Frames of maps have one size, on floors of any shape and with teams of any size."""

import numpy as np
import pytest
from films_read import share_of
from watched_frames import explored

import lidarium
from lidarium.envs.drawing.frame_parts import EXPLORED, team_colours
from lidarium.evaluation.drawing.films.map_frames import MapFrames


@pytest.mark.parametrize(
    ("floor", "robots", "resolution", "width"),
    [("apartment", 2, 0.025, 480), ("office:3", 6, 0.05, 400), ("office:3", 3, 0.05, 641)],
)
def test_frames_have_the_width_and_show_more_and_more(floor, robots, resolution, width):
    frames = MapFrames(lidarium.policy("nearest_frontier_own_map"), width)
    _, drawn = explored(frames.draw, floor, robots, resolution=resolution)
    assert {frame.shape for frame in drawn} == {(len(drawn[0]), width + width % 2, 3)}
    assert len(drawn[0]) % 2 == 0
    assert all(share_of(drawn[-1], colour) > 1e-3 for colour in team_colours(robots))
    # No maps are joined: nothing that is known is white, and it is more with time.
    pale = [np.array(colour) + (255 - np.array(colour)) * 2 // 3 for colour in team_colours(robots)]
    first, last = (sum(share_of(frame, tuple(colour)) for colour in pale) for frame in (drawn[0], drawn[-1]))
    assert first < last
    assert share_of(drawn[-1][len(drawn[-1]) // 2 :], EXPLORED) < 0.02
