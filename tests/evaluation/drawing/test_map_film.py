"""The film of maps: frames of one size, robots' own maps, joins."""

import numpy as np
import pytest
from films_read import share_of
from watched_frames import explored

import lidarium
from lidarium.envs.drawing.frame_parts import EXPLORED, team_colours
from lidarium.evaluation.drawing.map_film import GAP, LINE, MOST_IN_A_ROW, MapFrames, OwnMaps


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


def test_maps_of_robots_do_not_move_as_they_grow():
    tiles = []

    def draw(env):
        if not tiles:
            tiles.append(OwnMaps(env, 600))
        return tiles[0].draw(env, [{0}, {1}, {2}])

    env, drawn = explored(draw)
    width = 600 // 3
    for robot, colour in enumerate(team_colours(3)):
        side = slice(robot * width, robot * width + width - 10)
        walls = [(np.abs(frame[LINE:, side].astype(int) - colour) <= 2).all(axis=2) for frame in drawn]
        before, after = walls[0].sum(), (walls[0] & walls[-1]).sum()
        assert before > 50
        # All but the robot itself, and what later scans correct, is where it was.
        assert after > 0.6 * before
    assert not np.array_equal(drawn[0], drawn[-1])
    assert env.beliefs.believed.shape == (3, 3)


def test_maps_that_are_joined_have_another_line():
    drawn = {}

    def draw(env):
        tiles = OwnMaps(env, 600)
        drawn["alone"], drawn["joined"] = tiles.draw(env, [{0}, {1}]), tiles.draw(env, [{0, 1}])
        return drawn["alone"]

    explored(draw, robots=2, horizon_s=1.0)
    alone, joined = drawn["alone"], drawn["joined"]
    assert (alone[2, 2] == team_colours(2)[0]).all()
    assert (joined[2, 2] == joined[2, 400]).all()
    assert (joined[2, 2] != alone[2, 2]).any()
    assert (alone[LINE:] == joined[LINE:]).all()


def test_a_larger_team_has_more_rows_of_tiles():
    env, _ = explored(lambda env: None, robots=MOST_IN_A_ROW + 1, horizon_s=0.1, floor="office:3")
    height = min((500 - 3 * GAP) // 4, 150)
    picture = OwnMaps(env, 500).draw(env, [{robot} for robot in range(5)])
    assert picture.shape == (2 * (LINE + height + GAP), 500, 3)
