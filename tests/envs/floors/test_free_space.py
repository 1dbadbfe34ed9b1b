"""Free space against slow references, and what rasters keep of it."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from lidarium.envs.floors import free_space
from lidarium.envs.floors.floor import Floor, Raster, Solid
from lidarium.envs.floors.free_space import (
    KEPT,
    components,
    configuration_space,
    measure_building,
    reachable_free_space,
)
from lidarium.envs.floors.generation.furniture import place
from lidarium.envs.floors.starts import draw_starts
from tests.envs.floors.rooms import two_rooms


def random_raster(seed, share):
    solid = np.ones((24, 32), np.uint8)
    solid[1:-1, 1:-1] = np.random.default_rng(seed).random((22, 30)) < share
    return Raster(solid, (0.0, 0.0), 0.05)


@settings(max_examples=40)
@given(st.integers(0, 1000), st.floats(0.0, 0.2), st.sampled_from([0.0, 0.01, 0.05, 0.1, 0.12, 0.18, 0.2]))
def test_the_configuration_space_keeps_the_radius_from_every_solid_square(seed, share, radius):
    raster = random_raster(seed, share)
    i, j = np.indices(raster.solid.shape)
    rows, columns = raster.solid.nonzero()
    across = np.maximum(np.abs(i[..., None] - rows) - 0.5, 0.0)
    along = np.maximum(np.abs(j[..., None] - columns) - 0.5, 0.0)
    distance = np.hypot(across, along).min(axis=-1) * raster.resolution
    np.testing.assert_array_equal(
        configuration_space(raster, radius), (distance >= radius - 1e-9) & (raster.solid == 0)
    )


@settings(max_examples=40)
@given(st.integers(0, 1000), st.sampled_from([0.0, 0.05, 0.1, 0.12]))
def test_the_swept_space_is_what_discs_cover_from_the_start(seed, radius):
    raster = random_raster(seed, 0.05)
    space = configuration_space(raster, radius)
    labels, count = ndimage.label(space)
    if count == 0:
        return
    row, column = (indices[0] for indices in space.nonzero())
    kept = np.argwhere(labels == labels[row, column])
    i, j = np.indices(space.shape)
    near = (
        np.hypot(i[..., None] - kept[:, 0], j[..., None] - kept[:, 1]).min(axis=-1) * raster.resolution <= radius + 1e-9
    )
    start = np.array([[(column + 0.5) * 0.05, (row + 0.5) * 0.05, 0.0]])
    np.testing.assert_array_equal(reachable_free_space(raster, radius, start), near & (raster.solid == 0))


@pytest.mark.parametrize("radius", [0.01, 0.1, 0.18, 0.2, 0.267, 0.3, 0.34])
def test_a_body_in_an_empty_room_sweeps_the_last_free_cell_before_each_straight_wall(radius):
    solid = np.ones((80, 100), np.uint8)
    solid[1:-1, 1:-1] = 0
    swept = reachable_free_space(Raster(solid, (0.0, 0.0), 0.025), radius, np.array([[1.2, 1.0]]))
    corner = math.ceil(radius / 0.025 + 0.5)
    assert swept[1, corner:-corner].all()
    assert swept[corner:-corner, 1].all()
    assert swept.sum() >= 78 * 98 - 4 * corner**2
    assert not swept[solid == 1].any()


def test_a_sealed_room_is_never_swept():
    swept = reachable_free_space(two_rooms(), 0.18, np.array([[1.0, 1.0, 0.0]]))
    assert 0.97 < swept.sum() * 0.025**2 / 16.0 <= 1.0


def test_a_door_is_passed_by_a_robot_that_fits_and_by_no_other():
    start = np.array([[1.0, 1.0, 0.0]])
    assert reachable_free_space(two_rooms(0.8), 0.18, start).sum() * 0.025**2 > 23.0
    assert reachable_free_space(two_rooms(0.8), 0.45, start).sum() * 0.025**2 < 17.0


def test_both_rooms_are_swept_if_robots_start_in_both():
    swept = reachable_free_space(two_rooms(), 0.18, np.array([[1.0, 1.0], [5.0, 2.0]]))
    assert swept.sum() * 0.025**2 > 23.0


@pytest.mark.parametrize("radius", [-0.1, math.nan])
def test_a_bad_radius_is_refused(radius):
    with pytest.raises(ValueError, match="radius is"):
        configuration_space(two_rooms(), radius)


@settings(max_examples=40)
@given(st.integers(0, 1000), st.floats(0.0, 0.5), st.sampled_from([0.0, 0.05, 0.12]))
def test_components_are_numbered_and_measured(seed, share, radius):
    raster = random_raster(seed, share)
    space = configuration_space(raster, radius)
    found = components(raster, radius)
    expected, count = ndimage.label(space)
    assert found.labels.dtype == np.uint8
    assert found.areas.tolist() == np.bincount(found.labels.ravel(), minlength=count + 1).tolist()
    # The same components, whatever their numbers.
    pairs = set(zip(expected.ravel().tolist(), found.labels.ravel().tolist(), strict=True))
    assert len(pairs) == count + (0 in expected)


def read_only(raster):
    raster.solid.flags.writeable = False
    return raster


def test_what_a_shared_raster_is_asked_again_is_kept_and_is_what_a_new_one_gives():
    raster, start = read_only(two_rooms(0.8)), np.array([[1.0, 1.0, 0.0]])
    size = raster.nbytes
    first = reachable_free_space(raster, 0.18, start)
    assert size < raster.nbytes < 1.2 * size
    second = reachable_free_space(raster, 0.18, start)
    assert not second.flags.writeable
    np.testing.assert_array_equal(first, second)
    for radius in (0.18, 0.45):
        for point in ((1.0, 1.0), (5.0, 2.0)):
            at = np.array([point])
            np.testing.assert_array_equal(
                reachable_free_space(raster, radius, at), reachable_free_space(two_rooms(0.8), radius, at)
            )


def test_starts_drawn_on_a_raster_that_keeps_are_those_of_a_new_one():
    raster, generator, other = read_only(two_rooms()), np.random.default_rng(3), np.random.default_rng(3)
    for _ in range(5):
        np.testing.assert_array_equal(draw_starts(raster, 0.18, 3, generator), draw_starts(two_rooms(), 0.18, 3, other))


def test_a_raster_keeps_no_more_than_it_may_and_one_that_can_be_written_to_nothing():
    raster = read_only(two_rooms())
    for radius in np.linspace(0.1, 0.2, 3 * KEPT):
        components(raster, radius)
        components(raster, radius)
        assert len(raster.kept) <= KEPT
    own = two_rooms()
    before = components(own, 0.18), components(own, 0.18)
    assert before[0] is not before[1]
    own.solid[60:100, :] = 1
    assert components(own, 0.18).areas.size == 5 > before[0].areas.size
    assert not own.kept


def test_the_free_space_of_a_floor_in_use_is_not_made_again(monkeypatch):
    raster = read_only(two_rooms())
    components(raster, 0.18)
    monkeypatch.setattr(free_space, "configuration_space", lambda *_: pytest.fail("made again"))
    components(raster, 0.18)


def test_a_ring_around_a_block_is_one_loop_and_a_table_in_it_none():
    block = place("wardrobe", 0.0, 0.0, 0.0)[0].polygon
    walls = Floor("ring", (-3.0, -3.0, 3.0, 3.0), (type(place("box", 0.0, 0.0, 0.0)[0])(block),))
    assert measure_building(walls).loops == 1
    furnished = Floor("table", (-3.0, -3.0, 3.0, 3.0), place("box", 0.0, 0.0, 0.0))
    assert measure_building(furnished).loops == 0
    assert measure_building(furnished).clutter > 0.0


def wall(x, y, width, height, **given):
    return Solid(np.array([[x, y], [x + width, y], [x + width, y + height], [x, y + height]]), **given)


def test_a_door_parts_two_rooms_and_a_wide_opening_does_not():
    for gap, rooms in ((0.9, 2), (1.8, 1)):
        half = (4.0 - gap) / 2
        walls = (wall(3.9, 0.0, 0.2, half), wall(3.9, 4.0 - half, 0.2, half))
        found = measure_building(Floor("two", (0.0, 0.0, 8.0, 4.0), walls))
        assert (found.rooms, found.loops) == (rooms, 0)
        assert found.area_m2 == pytest.approx(32.0 - 0.4 * half, rel=0.03)


def test_clutter_is_what_furniture_covers():
    floor = Floor("one", (0.0, 0.0, 4.0, 4.0), (wall(1.0, 1.0, 2.0, 1.0, z_high=0.5),))
    assert measure_building(floor).clutter == pytest.approx(2.0 / 16.0, rel=0.05)
    assert measure_building(Floor("none", (0.0, 0.0, 4.0, 4.0))).clutter == 0.0


def test_walls_below_the_ceiling_are_no_furniture():
    walls = (wall(3.9, 0.0, 0.2, 1.55, z_high=1.3), wall(3.9, 2.45, 0.2, 1.55, z_high=1.3))
    shelf = wall(0.5, 0.5, 2.0, 0.4, z_high=1.8)
    found = measure_building(Floor("low", (0.0, 0.0, 8.0, 4.0), (*walls, shelf), wall_height=1.3))
    assert found.rooms == 2
    assert found.clutter == pytest.approx(0.8 / 31.4, rel=0.05)


def test_a_floor_without_room_is_refused():
    with pytest.raises(ValueError, match=r"floor 'narrow' has no room for a robot of radius 0\.3 m"):
        measure_building(Floor("narrow", (0.0, 0.0, 0.4, 5.0)))
