"""What a team sees from where it stands."""

import numpy as np
import pytest
from seen_truth import NEAR, begun

from lidarium.envs.simulation.kernels.arrays import ENDED
from lidarium.evaluation.truth.footprints import Footprints


def counts_of(masks):
    sums = np.sum([np.unpackbits(mask.view(np.uint8)) for mask in masks], axis=0, dtype=np.int64)
    return int((sums >= 1).sum()), int((sums >= 2).sum())


@pytest.mark.parametrize("starts", [NEAR, [*NEAR, (3.0, 4.3, 3.0)], [*NEAR, NEAR[0] + (0.6, 0.0, 0.0)]])
def test_cells_are_counted_that_one_and_that_two_see(starts):
    env = begun(starts)
    footprints = Footprints(env)
    wanted = counts_of(env.score.masks)
    assert wanted[1] > 0
    assert footprints.count(env) == footprints.count(env) == wanted


def test_robots_whose_footprints_cannot_meet_count_nothing():
    env = begun([(2.5, 4.0, 0.0), (8.4, 6.3, 0.0)])
    env.world.poses[1, 0] += 2.0 * env.settings.lidar.range_max
    assert Footprints(env).count(env) == (0, 0)


def test_who_has_ended_sees_nothing():
    env = begun([*NEAR, (3.0, 4.3, 3.0)])
    env.world.flags[2] |= ENDED
    assert Footprints(env).count(env) == counts_of(env.score.masks[:2])
