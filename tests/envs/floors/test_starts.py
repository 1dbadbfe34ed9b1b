import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lidarium.envs.floors.floor import Floor, Raster
from lidarium.envs.floors.starts import check_starts, draw_starts
from tests.envs.floors.rooms import two_rooms


@settings(max_examples=30)
@given(st.integers(0, 10_000), st.integers(1, 8))
def test_drawn_starts_fit_keep_their_distance_and_share_the_largest_room(seed, count):
    raster = two_rooms()
    starts = draw_starts(raster, 0.18, count, np.random.default_rng(seed))
    assert starts.shape == (count, 3)
    assert starts.dtype == np.float64
    assert (starts[:, 0] < 4.0).all()
    check_starts(raster, 0.18 + 0.025, starts)
    apart = [math.dist(a[:2], b[:2]) for k, a in enumerate(starts) for b in starts[:k]]
    assert min(apart, default=math.inf) >= 4 * 0.18 - 1e-9
    assert (np.abs(starts[:, 2]) <= math.pi).all()


def test_the_same_seed_draws_the_same_starts():
    first, again, other = (draw_starts(two_rooms(), 0.18, 4, np.random.default_rng(seed)) for seed in (5, 5, 6))
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)


def test_starts_are_spread_evenly_over_the_room():
    generator = np.random.default_rng(0)
    raster = two_rooms()
    x = np.array([draw_starts(raster, 0.18, 1, generator)[0, 0] for _ in range(400)])
    assert abs((x < 2.0).mean() - 0.5) < 0.1


def test_proposed_starts_come_first_and_choose_the_room():
    proposed = np.array([[5.0, 1.0, 0.3], [5.0, 3.0, 0.4]])
    starts = draw_starts(two_rooms(), 0.18, 3, np.random.default_rng(0), proposed)
    np.testing.assert_array_equal(starts[:2], proposed)
    assert starts[2, 0] > 4.1
    np.testing.assert_array_equal(draw_starts(two_rooms(), 0.18, 1, np.random.default_rng(0), proposed), proposed[:1])


def test_a_proposed_start_too_near_to_a_wall_is_passed_over():
    proposed = np.array([[0.1, 1.0, 0.0], [1.0, 1.0, 0.0], [1.1, 1.0, 0.0]])
    starts = draw_starts(two_rooms(), 0.18, 2, np.random.default_rng(0), proposed)
    np.testing.assert_array_equal(starts[0], proposed[1])
    assert not np.array_equal(starts[1], proposed[2])


def test_a_proposed_start_inside_a_wall_is_refused():
    with pytest.raises(ValueError, match="inside a wall"):
        draw_starts(two_rooms(), 0.18, 1, np.random.default_rng(0), np.array([[-5.0, 1.0, 0.0]]))


def test_disconnected_proposed_starts_are_refused():
    with pytest.raises(ValueError, match="disconnected"):
        draw_starts(two_rooms(), 0.18, 2, np.random.default_rng(0), np.array([[1.0, 1.0, 0.0], [5.0, 1.0, 0.0]]))


def test_a_robot_that_fits_nowhere_is_refused():
    with pytest.raises(ValueError, match="does not fit anywhere"):
        draw_starts(two_rooms(), 2.5, 1, np.random.default_rng(0))
    with pytest.raises(ValueError, match="does not fit anywhere"):
        draw_starts(Raster(np.ones((8, 8), np.uint8), (0.0, 0.0), 0.1), 0.1, 1, np.random.default_rng(0))


def test_more_robots_than_fit_are_refused_with_how_many_did():
    raster = Floor("closet", (0.0, 0.0, 1.2, 1.2)).raster(0.05, 0.0, 1.0)
    assert len(draw_starts(raster, 0.18, 2, np.random.default_rng(0))) == 2
    with pytest.raises(ValueError, match=r"9 robots of radius 0.18 m do not fit .*; [234] did"):
        draw_starts(raster, 0.18, 9, np.random.default_rng(0))


def test_starts_that_a_user_insists_on_must_fit_and_not_overlap():
    check_starts(two_rooms(0.8), 0.18, np.array([[1.0, 1.0, 0.0], [5.0, 1.0, 0.0]]))
    with pytest.raises(ValueError, match="disconnected"):
        check_starts(two_rooms(), 0.18, np.array([[1.0, 1.0, 0.0], [5.0, 1.0, 0.0]]))
    with pytest.raises(ValueError, match="nearer than the radius"):
        check_starts(two_rooms(), 0.18, np.array([[0.175, 1.0, 0.0]]))
    with pytest.raises(ValueError, match="does not fit at start"):
        check_starts(two_rooms(), 0.18, np.array([[0.06, 1.0, 0.0]]))
    with pytest.raises(ValueError, match=r"robots 0 and 1 are 0\.100 m apart"):
        check_starts(two_rooms(), 0.18, np.array([[1.0, 1.0, 0.0], [1.1, 1.0, 0.0]]))


@pytest.mark.parametrize("count", [0, -1])
def test_a_team_without_robots_is_refused(count):
    with pytest.raises(ValueError, match="at least 1"):
        draw_starts(two_rooms(), 0.18, count, np.random.default_rng(0))
