"""Safe regions of a scan: balls, stars and radial regions."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from seen_from_nodes import BODY, HERE, PERCEPTION, box_view, region

from lidarium.agents.srt.safe_region import (
    ANGLES,
    DIRECTIONS,
    STEP,
    UNIT,
    _region_of,
    joined_views,
    openings_of,
    safe_region,
    view_of,
)
from lidarium.agents.srt.settings import SHAPES
from lidarium.mapping.grids.scan_geometry import ScanGeometry

URG = ScanGeometry()


def test_the_five_laser_regions_go_from_right_to_left():
    degrees = np.array([-120, -73, -72, -25, -24, 0, 23, 24, 71, 72, 119, 121, 179])
    assert _region_of(np.radians(degrees)).tolist() == [0, 0, 1, 1, 2, 2, 2, 3, 3, 4, 4, 5, 6]


@settings(max_examples=20)
@given(st.integers(0, 2**31), st.floats(-3.0, 3.0))
def test_a_ball_lies_within_the_star_and_the_star_within_the_radial_region(seed, heading):
    generator = np.random.default_rng(seed)
    view = np.repeat(generator.uniform(0.3, 5.0, DIRECTIONS // 30), 30)
    view[generator.integers(DIRECTIONS, size=50)] = np.nan
    ball, star, radial = (region(view, shape, heading=heading).radii for shape in ("ball", "star", "radial"))
    assert (ball <= star + 1e-9).all()
    assert (star <= radial + 1e-9).all()
    assert (radial[np.isnan(view)] == 0.0).all()


@settings(max_examples=15)
@given(st.integers(0, 2**31))
def test_no_end_of_a_ray_comes_within_the_body_on_the_way_through_a_region(seed):
    generator = np.random.default_rng(seed)
    view = np.repeat(generator.uniform(0.4, 3.5, DIRECTIONS // 20), 20)
    ends = view[:, None] * UNIT
    for shape in SHAPES:
        radii = region(view, shape).radii
        for direction in generator.integers(DIRECTIONS, size=8):
            way = np.linspace(0.0, radii[direction], 30)[:, None] * UNIT[direction]
            gaps = np.linalg.norm(way[:, None] - ends[None], axis=2)
            assert gaps.min() >= BODY - 0.01


def radial_by_rays(ranges, body):
    """Return the radii of a radial region as its definition has them: each ray against all others."""
    radii = np.where(np.isnan(ranges), 0.0, np.maximum(ranges - body, 0.0))
    widest = math.ceil(math.asin(min(body / np.nanmin(ranges), 1.0)) / STEP)
    for shift in (*range(-widest, 0), *range(1, widest + 1)):
        other = np.roll(ranges, shift)
        across = other * math.sin(abs(shift) * STEP)
        with np.errstate(invalid="ignore"):
            limit = other * math.cos(shift * STEP) - np.sqrt(np.maximum(body * body - across * across, 0.0))
        radii = np.where(across < body, np.minimum(radii, np.maximum(limit, 0.0)), radii)
    return radii


@settings(max_examples=20)
@given(st.integers(0, 2**31))
def test_a_radial_region_is_to_the_bit_that_of_its_definition(seed):
    generator = np.random.default_rng(seed)
    view = np.repeat(generator.uniform(0.1, 5.0, DIRECTIONS // 12), 12)
    view[generator.integers(DIRECTIONS, size=80)] = np.nan
    expected = radial_by_rays(np.minimum(view, PERCEPTION), BODY)
    assert np.array_equal(region(view, "radial").radii, expected)


def test_points_within_a_region_are_told():
    square = region(box_view(), place=np.array([1.0, 1.0]))
    points = np.array([[1.0, 1.0], [2.7, 1.0], [2.9, 1.0], [1.0, -0.7], [4.0, 4.0]])
    assert square.contains(points).tolist() == [True, True, False, True, False]


def test_a_region_with_a_near_return_is_not_safe_to_turn_in():
    view = box_view()
    view[0] = 0.25
    radii = safe_region(HERE, view, 0.0, "radial", BODY, PERCEPTION, turn_room=0.1).radii
    assert (radii[_region_of(ANGLES) == 2] == 0.0).all()
    assert (radii[_region_of(ANGLES) == 4] > 0.0).all()


def test_a_scan_becomes_ranges_along_the_axes_of_the_map():
    scan = np.full(727, 3.0, np.float32)
    scan[363], scan[400] = 1.0, np.nan
    view = view_of(scan, URG, heading=math.pi / 2)
    assert view[DIRECTIONS // 4] == 1.0
    assert np.isnan(view).sum() == pytest.approx(DIRECTIONS // 3, abs=4)
    assert np.isnan(view[round((math.pi / 2 + 37 * URG.angle_increment) / STEP)])
    assert np.isnan(view[3 * DIRECTIONS // 4])
    assert not np.isnan(joined_views(view, view_of(scan, URG, -math.pi / 2))[3 * DIRECTIONS // 4])


@pytest.mark.parametrize("value", [5.6, np.float32(5.6), math.inf])
def test_a_beam_that_meets_nothing_is_endless(value):
    assert np.isinf(view_of(np.full(727, value, np.float32), URG, 0.0)[0])


def test_a_closed_room_has_no_opening_and_a_door_is_one():
    assert openings_of(HERE, box_view(), PERCEPTION, BODY, with_blind=False) == []
    arcs = [
        each
        for each in openings_of(HERE, box_view(door=(0.5, 0.8)), PERCEPTION, BODY, with_blind=False)
        if not each.is_gap
    ]
    assert len(arcs) == 1
    assert arcs[0].width == pytest.approx(0.3, abs=0.02)
    assert arcs[0].lengths.sum() == pytest.approx(0.3 * PERCEPTION, rel=0.05)


def test_an_arc_across_the_first_direction_is_one_and_a_narrow_one_is_none():
    across = box_view()
    across[:60], across[-60:] = np.inf, np.inf
    assert [
        each.width for each in openings_of(HERE, across, PERCEPTION, BODY, with_blind=False) if not each.is_gap
    ] == [pytest.approx(120 * STEP)]
    narrow = [
        each
        for each in openings_of(HERE, box_view(door=(0.5, 0.54)), PERCEPTION, BODY, with_blind=False)
        if not each.is_gap
    ]
    assert narrow == []


def test_a_gap_beside_an_edge_is_looked_into_on_the_hidden_side():
    view = np.full(DIRECTIONS, 3.0)
    view[: DIRECTIONS // 4] = 1.0
    gaps = openings_of(HERE, view, PERCEPTION, BODY, with_blind=False)
    assert len(gaps) == 2
    first = next(each for each in gaps if each.points[0, 1] > 0.5)
    assert (first.beyond[:, 0] > first.points[:, 0]).all()
    assert np.linalg.norm(first.points, axis=1).min() >= 1.0
    assert np.linalg.norm(first.points, axis=1).max() <= 3.0
