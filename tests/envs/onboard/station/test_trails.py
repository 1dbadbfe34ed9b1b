"""No walls can be where robots have been."""

import numpy as np

from lidarium.envs.onboard.station.trails import without_bodies, without_own_trail
from lidarium.mapping.grids.occupancy import FREE, OCCUPIED, UNKNOWN
from lidarium.mapping.merging.incremental import GrowingMap
from lidarium.mapping.planning.footprint import MARGIN_M

RADIUS, RESOLUTION = 0.2, 0.1
TRAIL = np.array([(1.05, 1.05), (1.55, 1.05)])


def drawn(seed=0):
    levels = np.random.default_rng(seed).choice([FREE, UNKNOWN, OCCUPIED], (30, 40)).astype(np.uint8)
    return GrowingMap(levels, (-1.0, 0.0))


def near_trail(one, trail):
    """Return which cells have their centre within a body of any place of a trail, cell by cell."""
    rows, columns = np.indices(one.levels.shape)
    x = one.origin[0] + (columns + 0.5) * RESOLUTION
    y = one.origin[1] + (rows + 0.5) * RESOLUTION
    return np.min([np.hypot(x - place[0], y - place[1]) for place in trail], axis=0)


def test_of_its_own_trail_a_map_claims_nothing():
    one = drawn()
    cleared, away = without_own_trail(one, TRAIL, RADIUS, RESOLUTION), near_trail(one, TRAIL)
    assert (cleared.levels[away < RADIUS - 0.06] == UNKNOWN).all()
    beyond = away > RADIUS + MARGIN_M + RESOLUTION
    assert np.array_equal(cleared.levels[beyond], one.levels[beyond])
    assert cleared.origin == one.origin
    assert np.array_equal(one.levels, drawn().levels)


def test_of_others_trails_walls_alone_are_taken_away():
    one = drawn(1)
    trails = [TRAIL, TRAIL + np.array([0.0, 1.0])]
    cleared = without_bodies(one, trails, RADIUS, RESOLUTION)
    changed = cleared.levels != one.levels
    assert changed.any()
    assert (one.levels[changed] == OCCUPIED).all()
    assert (cleared.levels[changed] == UNKNOWN).all()
    away = np.minimum(*(near_trail(one, trail) for trail in trails))
    assert not (cleared.levels[away < RADIUS - 0.06] == OCCUPIED).any()


def test_without_others_nothing_changes():
    assert np.array_equal(without_bodies(drawn(), [], RADIUS, RESOLUTION).levels, drawn().levels)
