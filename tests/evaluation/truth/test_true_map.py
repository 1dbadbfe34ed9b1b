"""What is true of a floor, on the lattice of the maps."""

import numpy as np
import pytest
from seen_truth import begun

from lidarium.envs.floors.floor import Floor, Raster
from lidarium.evaluation.truth.true_map import left_by_failed, occupied_in_truth, truth_of

SIDE = 0.05


def floor_of(solid):
    height, width = (SIDE * side for side in solid.shape)
    return Floor("hand", (0.0, 0.0, width, height), cells=Raster(solid, (0.0, 0.0), SIDE))


@pytest.fixture
def closet():
    """A room of 4 x 3 m with a wall 20 cm thick, behind which there is a sealed closet."""
    solid = np.ones((60, 80), np.uint8)
    solid[2:58, 2:50] = 0
    solid[2:58, 54:78] = 0
    return floor_of(solid)


def at(env, x, y):
    """Return the row and column of a place."""
    origin = env.world.floors[0].laser.origin
    return tuple(
        int((value - corner) / env.settings.occupancy.resolution) for value, corner in ((y, origin[1]), (x, origin[0]))
    )


@pytest.mark.parametrize("resolution", [0.05, 0.1])
def test_a_sealed_room_and_the_inside_of_walls_cannot_be_known(closet, resolution):
    env = begun([(1.0, 1.5, 0.0)], closet, resolution=resolution)
    truth = truth_of(env)
    assert truth.knowable[at(env, 1.0, 1.0)]
    assert truth.knowable[at(env, 2.52, 1.0)]
    assert truth.occupied[at(env, 2.52, 1.0)]
    assert not truth.knowable[at(env, 2.62, 1.0)]
    assert not truth.knowable[at(env, 3.3, 1.0)]
    assert not truth.occupied[at(env, 3.3, 1.0)]
    assert (truth.counted <= truth.valid).all()
    assert (truth.valid <= truth.knowable).all()


def test_a_cell_is_occupied_where_any_of_its_cells_is():
    solid = np.ones((40, 40), np.uint8)
    solid[2:38, 2:38] = 0
    solid[21, 31] = 1
    env = begun([(0.6, 0.6, 0.0)], floor_of(solid), resolution=0.1)
    occupied = occupied_in_truth(env)
    assert occupied[at(env, 1.57, 1.07)]
    assert not occupied[at(env, 1.47, 1.07)]
    rows = env.world.floors[0].laser.solid.shape[0] * env.world.floors[0].laser.resolution / 0.1
    assert not occupied[int(np.ceil(rows)) :].any()


def test_a_failed_robot_in_a_corridor_cuts_off_what_is_behind_it():
    solid = np.ones((20, 120), np.uint8)
    solid[5:14, 2:118] = 0
    env = begun([(1.0, 0.48, 0.0), (3.0, 0.48, 0.0)], floor_of(solid))
    assert left_by_failed(env) is None
    env.world.failed[1] = 1
    left, counted = left_by_failed(env), truth_of(env).counted
    assert left[at(env, 2.0, 0.48)]
    assert counted[at(env, 5.0, 0.48)]
    assert not left[at(env, 5.0, 0.48)]
    assert (left <= counted[:, : left.shape[1]]).all()
    env.world.failed[:] = 1
    assert left_by_failed(env) is None
