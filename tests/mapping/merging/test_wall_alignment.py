"""Walls of one map pull those of another into place."""

import math

import numpy as np
import pytest
from drawn_maps import RESOLUTION, about_middle, apartment, blank, kept, moved

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.merging.described_map import describe_map
from lidarium.mapping.merging.wall_alignment import rank_by_walls, refine_on_walls, wall_sample


@pytest.mark.parametrize("error", [(0.2, -0.2, 2.0), (-0.15, 0.25, -3.0), (0.0, 0.0, 4.0)])
def test_walls_pull_a_transform_into_place(error):
    pose = about_middle(0.4, apartment())
    a, b = describe_map(moved(apartment(), pose), RESOLUTION), describe_map(apartment(), RESOLUTION)
    x, y, degrees = error
    turn = Transform(pose.x, pose.y, pose.theta + math.radians(degrees))
    middle = np.array([5.0, 4.0])
    shift = pose.apply(middle) - turn.apply(middle)
    start = Transform(turn.x + shift[0] + x, turn.y + shift[1] + y, turn.theta)
    found = refine_on_walls(a, b, start, 0.4, 800)
    assert found.difference(pose, middle)[0] < 0.03
    assert found.difference(pose)[1] < math.radians(0.3)


def test_the_two_sides_of_a_thin_wall_are_not_laid_on_each_other():
    """Two robots know a hall, and the room on either side of a wall of 10 cm, whose faces noise has left
    full of holes."""
    side, floor = 0.025, blank(140, 200)
    floor[18:122, 18:182] = 0
    floor[20:50, 20:180] = 255
    floor[52:120, 20:98] = 255
    floor[52:120, 102:180] = 255
    floor[48:52, 60:64] = 0
    floor[48:52, 136:140] = 0
    generator = np.random.default_rng(4)
    maps = []
    for known in (slice(0, 100), slice(100, 200)):
        one = kept(floor, slice(0, 140), known)
        one[:52] = floor[:52]
        one[:52, :30] = one[:52, 170:] = 127
        one[(one == 0) & (generator.random(one.shape) < 0.3)] = 255
        maps.append(describe_map(one, side))
    for start in (Transform(), Transform(0.05, 0.0, 0.0), Transform(-0.05, 0.0, 0.0)):
        distance, angle = refine_on_walls(*maps, start, 0.4, 1600).difference(Transform(), (2.0, 1.5))
        assert distance < 0.03
        assert angle < math.radians(1.0)


def test_a_sample_of_walls_reaches_from_the_first_to_the_last():
    assert wall_sample(5, 10).tolist() == [0, 1, 2, 3, 4]
    assert wall_sample(101, 5).tolist() == [0, 25, 50, 75, 100]
    assert len(wall_sample(0, 10)) == 0


def test_walls_on_walls_rank_a_proposal_first_and_walls_in_the_open_count_against_it():
    one = describe_map(apartment(), RESOLUTION)
    proposals = np.array([(0.0, 0.0, 0.0), (0.1, 0.0, 0.0), (1.0, 0.7, 0.0), (100.0, 0.0, 0.0)])
    scores = rank_by_walls(one, one, proposals, 400)
    assert scores[0] == 400
    assert 0 < scores[1] <= 400
    assert scores[2] < 0
    assert scores[3] == 0


def test_a_map_that_finds_no_walls_stays_where_it_is():
    one, none = describe_map(apartment(), RESOLUTION), describe_map(blank(), RESOLUTION)
    start = Transform(1.0, 2.0, 0.3)
    assert refine_on_walls(one, none, start, 0.4, 100) == start
    assert refine_on_walls(none, one, start, 0.4, 100) == start
    assert refine_on_walls(one, one, Transform(50.0, 0.0, 0.0), 0.4, 100) == Transform(50.0, 0.0, 0.0)


def test_a_straight_wall_holds_a_map_across_it_alone():
    levels = blank(100, 160)
    levels[48:50], levels[50:80] = 0, 255
    one = describe_map(levels, RESOLUTION)
    found = refine_on_walls(one, one, Transform(0.3, 0.15, 0.0), 0.4, 200)
    assert found.y == pytest.approx(0.0, abs=RESOLUTION)
    assert found.x == pytest.approx(0.3, abs=0.01)
