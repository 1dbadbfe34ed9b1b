"""The arrays of a world reach its kernels where they lie, by their names."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from lidarium.envs.settings.lidar import Lidar
from lidarium.envs.simulation.kernels.arrays import (
    ANGLE_FIRST,
    ANGLE_INCREMENT,
    FULL_CIRCLE,
    LASER_HEIGHT,
    MAP_RESOLUTION,
    NOISE_FLOOR,
    NOISE_SHARE,
    RANGE_MAX,
    RANGE_MIN,
    TIME_STEP,
    WorldArrays,
    sensor_numbers,
    table_of_owners,
    world_at,
)
from lidarium.mapping.kernels.compilation import kernel


@kernel
def move_on(table):
    """Write into some arrays, and return the sizes of those that nobody has."""
    world = world_at(table)
    world.poses[1, 2] = world.sensor[0, 0] + world.travelled[0]
    world.flags[0] |= 4
    world.contacts[2] = 1
    return world.ranges.size + world.floor_rows.size


def test_kernels_write_into_the_arrays_of_the_first_owner_that_has_them():
    first = SimpleNamespace(poses=np.zeros((3, 3)), sensor=np.array([[1.5, 0.0]]), flags=np.ones(3, np.int64))
    second = SimpleNamespace(
        poses=np.zeros((3, 3)), travelled=np.array([0.25, 0.0, 0.0]), contacts=np.zeros(3, np.uint8)
    )
    assert move_on(table_of_owners(first, second)) == 0
    assert first.poses.tolist() == [[0.0] * 3, [0.0, 0.0, 1.75], [0.0] * 3]
    assert not second.poses.any()
    assert first.flags.tolist() == [5, 1, 1]
    assert second.contacts.tolist() == [0, 0, 1]


def test_a_table_has_address_rows_and_columns_of_each_array():
    owner = SimpleNamespace(poses=np.zeros((5, 3)), steps=np.zeros(7, np.int64))
    table = table_of_owners(owner)
    assert len(table) == len(WorldArrays._fields)
    place, steps = (WorldArrays._fields.index(name) for name in ("poses", "steps"))
    assert table[place].tolist() == [owner.poses.ctypes.data, 5, 3]
    assert table[steps, :2].tolist() == [owner.steps.ctypes.data, 7]


@pytest.mark.parametrize(
    ("array", "words"),
    [
        (np.zeros((3, 3), np.float32), "poses is float32 with 2 dimensions; want float64 with 2, contiguous"),
        (np.zeros(9), "poses is float64 with 1 dimensions; want float64 with 2"),
        (np.zeros((3, 6))[:, ::2], "poses is float64 with 2 dimensions; want float64 with 2, contiguous"),
    ],
)
def test_arrays_of_another_type_or_order_are_refused(array, words):
    with pytest.raises(TypeError, match=words):
        table_of_owners(SimpleNamespace(poses=array))


def test_a_sensor_is_known_by_its_numbers():
    lidar = Lidar(
        beams=5,
        field_of_view=math.pi,
        range_min=0.05,
        range_max=7.0,
        noise_floor=0.01,
        noise_share=0.02,
        height=0.3,
    )
    around = Lidar(beams=5, field_of_view=2.0 * math.pi)
    numbers, numbers_around = sensor_numbers([lidar, around], 0.2, 0.05)
    assert numbers[[ANGLE_FIRST, ANGLE_INCREMENT]] == pytest.approx([-math.pi / 2, math.pi / 4])
    assert numbers[FULL_CIRCLE] == 0.0
    assert numbers[[RANGE_MIN, RANGE_MAX, NOISE_FLOOR, NOISE_SHARE]].tolist() == [0.05, 7.0, 0.01, 0.02]
    assert numbers[[LASER_HEIGHT, MAP_RESOLUTION, TIME_STEP]].tolist() == [0.3, 0.05, 0.2]
    assert numbers_around[FULL_CIRCLE] == 1.0
