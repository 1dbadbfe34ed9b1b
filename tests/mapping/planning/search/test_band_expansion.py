"""Steps from cell to cell, around walls and out of blocked zones."""

import math
from itertools import pairwise

import numpy as np
from searched_beliefs import RESOLUTION, made

from lidarium.mapping.planning.footprint import Footprint
from lidarium.mapping.planning.grid_planning import centres_of, discs_of, plan, search
from lidarium.mapping.planning.path_smoothing import waypoints


def test_no_step_cuts_a_corner_between_two_blocked_cells():
    belief = np.full((2, 2), -5, np.int8)
    belief[0, 1] = belief[1, 0] = 9
    space, field = made(belief, 0.1)
    assert plan(space, belief, field, (0, 0), (1, 1), Footprint(0.0, 0.05)) is None
    belief[:] = -5
    belief[0, 1] = belief[1, 0] = 0
    space, field = made(belief, 0.1)
    assert plan(space, belief, field, (0, 0), (1, 1), Footprint(0.0, 0.05)) is None


def test_a_body_too_near_to_a_wall_leaves_it():
    belief = np.full((60, 60), -5, np.int8)
    belief[:, 0] = 9
    space, field = made(belief)
    footprint = Footprint(0.18, 0.33)
    found = search(space, belief, field, (30, 5), footprint)
    path = found.path((30, 40))
    assert tuple(path[0]) == (30, 5)
    assert (np.diff(path[:4, 1]) == 1).all()
    assert found.cost((30, 5)) == 0.0
    assert math.isinf(found.cost((30, 6)))


def test_blocked_discs_are_passed_around_and_left():
    belief = np.full((80, 80), -5, np.int8)
    space, field = made(belief)
    footprint = Footprint(0.05, 0.1)
    discs = discs_of([(1.0, 1.0, 0.4)], (0.0, 0.0), RESOLUTION)
    found = search(space, belief, field, (39, 5), footprint, blocked=discs)
    centres = centres_of(found.path((39, 75)), (0.0, 0.0), RESOLUTION)
    assert np.hypot(*(centres - 1.0).T).min() >= 0.4
    distances = np.hypot(
        *(np.moveaxis(np.indices(belief.shape), 0, -1)[..., ::-1].reshape(-1, 2).T + 0.5) * RESOLUTION - 1.0
    ).reshape(80, 80)
    np.testing.assert_array_equal(np.isinf(found.costs()), distances < 0.4)
    line = waypoints(found.path((39, 75)), belief, field, footprint, blocked=discs)
    for tail, head in pairwise(line):
        points = tail + np.linspace(0, 1, 100)[:, None] * (head - tail)
        assert np.hypot(*(points - 1.0).T).min() >= 0.4 - 0.002
    inside = search(space, belief, field, (39, 30), footprint, blocked=discs)
    away = np.hypot(*(centres_of(inside.path((39, 5)), (0.0, 0.0), RESOLUTION) - 1.0).T)
    assert (np.diff(away) > 0).all()
    assert math.isinf(inside.cost((39, 39)))
    assert math.isfinite(inside.cost((39, 75)))
