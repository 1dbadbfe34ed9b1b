"""What is left to see of a floor that is known."""

import numpy as np
import pytest

from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.evaluation.bounds.view_graph import count, numbers_of
from lidarium.training.settings import TrainingSettings
from lidarium.training.teaching.known_floor import known_floor


@pytest.fixture
def floor():
    env = ExplorationEnv("apartment:7", TrainingSettings(settings={"resolution": 0.05}).team(1))
    env.reset(seed=0)
    return known_floor(env)


def test_what_is_unseen_is_what_the_score_has_not(floor):
    share = 1.0 - count(floor.unseen()) / len(floor.cells)
    assert share == pytest.approx(floor.env.scorer.coverage, abs=0.05)
    rows, columns = floor.cells.T
    counted = floor.env.score.counted_masks[0][rows, columns >> 6] >> (columns & 63).astype(np.uint64)
    # Points in cells that the score does not count are never left to see.
    is_counted = (counted & np.uint64(1)) > 0
    assert is_counted.mean() > 0.95
    seen = np.setdiff1d(np.flatnonzero(is_counted), numbers_of(floor.unseen()))
    assert len(seen) > 50
    points = floor.graph.points[seen]
    places = (points[:, ::-1] + 0.5) * floor.graph.laser.resolution + np.asarray(floor.graph.laser.origin)
    away = np.hypot(*(places - floor.env.world.poses[0, :2]).T)
    assert away.max() <= floor.env.settings.lidar.range_max + 0.1


def test_stops_show_all_that_is_left(floor):
    unseen = floor.unseen()
    stops = floor.stops(unseen, floor.graph.lengths[0], 1000)
    left = unseen & ~np.bitwise_or.reduce(floor.graph.views[stops], axis=0)
    assert count(left) <= 0.01 * len(floor.cells) + 2 * len(floor.cells) ** 0.5
    assert (np.diff(floor.graph.lengths[0][stops]) >= 0.0).all()
    assert len(floor.stops(unseen, floor.graph.lengths[0], 3)) == 3
    nothing = np.zeros_like(unseen)
    assert len(floor.stops(nothing, floor.graph.lengths[0], 10)) == 0


def test_the_nearest_place_is_found(floor):
    for number in (0, 5, 20):
        assert floor.node_at(floor.graph.places[number]) == number
