"""Floors that are too large are refused."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.path import Path as Outline
from scipy import ndimage

from lidarium.envs.floors.floor import (
    MAX_BEYOND_M,
    MAX_EXTENT_M,
    MAX_OUTLINE_M,
    Floor,
    Raster,
    Solid,
    _middle_line,
    _width_of,
    check_extent,
    check_pairs,
)

SQUARE = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])


def test_a_floor_up_to_the_limits_passes():
    check_extent("hall", (0.0, 0.0, MAX_EXTENT_M, 1.0), [SQUARE, SQUARE[:0]])
    check_extent("hall", (0.0, 0.0, 1.0, 1.0), [SQUARE - MAX_BEYOND_M])
    check_pairs("hall", 500, 500)


@pytest.mark.parametrize(
    ("bounds", "rings", "message"),
    [
        ((0.0, 0.0, MAX_EXTENT_M + 1.0, 1.0), (), "hall has a side of 10001 m"),
        ((2e8, 0.0, 2e8 + 1.0, 1.0), (), "up to 2e"),
        ((0.0, 0.0, np.nan, 1.0), (), "hall has a side of nan"),
        ((0.0, 0.0, 1.0, 1.0), [SQUARE, SQUARE + MAX_BEYOND_M + 1.0], "beyond its bounds"),
        ((0.0, 0.0, 1.0, 1.0), [SQUARE * np.nan], "beyond its bounds"),
    ],
)
def test_what_is_too_large_is_named(bounds, rings, message):
    with pytest.raises(ValueError, match=message):
        check_extent("hall", bounds, rings)


def test_outlines_are_measured_around_each_ring_and_not_between_them():
    far = (0.0, 0.0, 9000.0, 9000.0)
    side = MAX_OUTLINE_M / 4 / 20
    rings = [SQUARE * side] * 20
    check_extent("hall", far, [ring * (1.0 - 1e-6) for ring in rings])
    with pytest.raises(ValueError, match="m of walls"):
        check_extent("hall", far, [*rings, SQUARE])
    check_extent("hall", far, [SQUARE, SQUARE + 8000.0] * 100)


def test_too_many_pairs_are_refused():
    with pytest.raises(ValueError, match="501 walls and 500 doors"):
        check_pairs("hall", 501, 500)


SQUARE_OF_SOLID = np.array([(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0)])


def strip_along(length, thickness, angle):
    corners = np.array([(0.0, 0.0), (length, 0.0), (length, thickness), (0.0, thickness)])
    cosine, sine = math.cos(angle), math.sin(angle)
    return corners @ np.array([[cosine, sine], [-sine, cosine]]) + (100.0, -50.0)


def test_a_solid_cuts_what_its_heights_overlap_with():
    table = Solid(SQUARE_OF_SOLID, 0.7, 0.75)
    assert table.cuts(0.0, 2.0)
    assert not table.cuts(0.0, 0.7)
    assert not table.cuts(0.75, 2.0)
    assert table.cuts(0.7, 0.7)
    assert not table.cuts(0.75, 0.75)


def test_edges_are_those_of_polygon_and_holes():
    solid = Solid(SQUARE_OF_SOLID, holes=(SQUARE_OF_SOLID / 4 + 0.5,))
    assert solid.edges.shape == (8, 4)
    lengths = np.hypot(*(solid.edges[:, 2:] - solid.edges[:, :2]).T)
    assert lengths.sum() == pytest.approx(8.0 + 2.0)


@pytest.mark.parametrize("angle", [0.0, 0.4, 2.0])
def test_a_strip_is_as_wide_as_it_is_thick_and_its_middle_line_runs_along_it(angle):
    strip = strip_along(3.0, 0.1, angle)
    assert _width_of(strip) == pytest.approx(0.1, rel=1e-3)
    (line,) = _middle_line(strip)
    assert np.hypot(*(line[2:] - line[:2])) == pytest.approx(3.0)
    assert (line[:2] + line[2:]) / 2 == pytest.approx(strip.mean(axis=0))


def test_a_bent_strip_is_as_wide_as_the_strip():
    bent = np.array([(0, 0), (3, 0), (3, 3), (2.9, 3), (2.9, 0.1), (0, 0.1)], np.float64)
    assert _width_of(bent) == pytest.approx(2 * 0.59 / 12.0, rel=1e-6)
    assert len(_middle_line(bent)) == 6


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"z_low": 1.0, "z_high": 1.0}, "has no height; want z_low < z_high"),
        ({"polygon": SQUARE_OF_SOLID[:2]}, "polygon has shape"),
        ({"polygon": SQUARE_OF_SOLID * np.nan}, "not finite"),
        ({"holes": (SQUARE_OF_SOLID[:, :1],)}, "hole has shape"),
    ],
)
def test_what_is_no_prism_is_refused(given, message):
    with pytest.raises(ValueError, match=message):
        Solid(**{"polygon": SQUARE_OF_SOLID, **given})


def rectangle(x, y, width, height, turn=0.0):
    corners = np.array([[0.0, 0.0], [width, 0.0], [width, height], [0.0, height]])
    cosine, sine = math.cos(turn), math.sin(turn)
    return corners @ np.array([[cosine, sine], [-sine, cosine]]) + [x, y]


def centres(raster):
    rows, columns = raster.solid.shape
    x = raster.origin[0] + (np.arange(columns) + 0.5) * raster.resolution
    y = raster.origin[1] + (np.arange(rows) + 0.5) * raster.resolution
    return np.stack(np.meshgrid(x, y), axis=-1)


def test_an_empty_floor_is_free_within_its_bounds_and_solid_outside():
    raster = Floor("hall", (0.0, 0.0, 2.0, 1.0)).raster(0.05, 0.2, 0.2)
    assert raster.solid.sum() == raster.solid.size - 40 * 20
    assert raster.origin == (-0.1, -0.1)
    assert raster.solid[2:22, 2:42].sum() == 0


@pytest.mark.parametrize("resolution", [0.01, 0.02, 0.025, 0.05, 0.1, 0.3])
def test_rasters_are_padded_to_eight_with_a_solid_ring_and_an_origin_on_the_lattice(resolution):
    raster = Floor("hall", (-3.33, 7.77, 2.1, 9.99)).raster(resolution, 0.0, 1.0)
    assert raster.solid.shape[0] % 8 == 0
    assert raster.solid.shape[1] % 8 == 0
    assert all(abs(value / 0.1 - round(value / 0.1)) < 1e-9 for value in raster.origin)
    for edge in (raster.solid[0], raster.solid[-1], raster.solid[:, 0], raster.solid[:, -1]):
        assert edge.all()
    inside = (centres(raster) > np.subtract([-3.33, 7.77], 1e-9)).all(axis=-1) & (
        centres(raster) < np.add([2.1, 9.99], 1e-9)
    ).all(axis=-1)
    np.testing.assert_array_equal(raster.solid == 0, inside)


@settings(max_examples=40)
@given(
    st.lists(st.tuples(st.floats(0.3, 2.7), st.floats(0.3, 2.7)), min_size=3, max_size=9),
    st.sampled_from([0.02, 0.025, 0.05]),
)
def test_a_cell_is_solid_if_its_centre_is_in_a_thick_solid(points, resolution):
    points = np.array(points)
    middle = points.mean(axis=0)
    # A star around the middle is simple; a hole keeps it from being drawn as a thin wall.
    polygon = points[np.argsort(np.arctan2(*(points - middle).T))]
    hole = rectangle(4.0, 4.0, 1.0, 1.0)
    raster = Floor("star", (0.0, 0.0, 3.0, 3.0), (Solid(polygon, holes=(hole,)),)).raster(resolution, 0.0, 1.0)
    at = centres(raster)
    want = (
        Outline(np.vstack([polygon, polygon[:1]]), closed=True)
        .contains_points(at.reshape(-1, 2))
        .reshape(raster.solid.shape)
    )
    edges = np.stack([polygon, np.roll(polygon, -1, axis=0)], axis=1)
    along = edges[:, 1] - edges[:, 0]
    share = np.clip(
        ((at[..., None, :] - edges[:, 0]) * along).sum(-1) / np.maximum((along**2).sum(-1), 1e-12), 0.0, 1.0
    )
    clear = np.hypot(*np.moveaxis(at[..., None, :] - edges[:, 0] - share[..., None] * along, -1, 0)).min(axis=-1) > 1e-6
    within = ((at > 0.0) & (at < 3.0)).all(axis=-1)
    np.testing.assert_array_equal(raster.solid[within & clear] == 1, want[within & clear])


def test_holes_of_a_solid_are_free():
    ring = Solid(rectangle(0.0, 0.0, 2.0, 2.0), holes=(rectangle(0.5, 0.5, 1.0, 1.0),))
    raster = Floor("ring", (0.0, 0.0, 2.0, 2.0), (ring,)).raster(0.05, 0.0, 1.0)
    assert (raster.solid == 0).sum() == 20 * 20


def test_neighbours_that_share_an_edge_leave_no_cell_between_them():
    solids = (Solid(rectangle(0.0, 0.0, 1.025, 1.0)), Solid(rectangle(1.025, 0.0, 0.975, 1.0)))
    raster = Floor("pair", (0.0, 0.0, 2.0, 1.0), solids).raster(0.05, 0.0, 1.0)
    assert raster.solid.all()


@settings(max_examples=60)
@given(st.floats(0.0, math.pi), st.floats(0.001, 0.08), st.sampled_from([0.02, 0.025, 0.05]))
def test_no_ray_slips_through_a_thin_wall_however_it_is_turned(turn, thickness, resolution):
    direction = np.array([math.cos(turn), math.sin(turn)])
    wall = rectangle(*(np.array([1.513, 1.507]) - 3.0 * direction), 6.0, thickness, turn)
    free = Floor("thin", (0.0, 0.0, 3.0, 3.0), (Solid(wall),)).raster(resolution, 0.0, 1.0).solid == 0
    labels, count = ndimage.label(free, structure=np.ones((3, 3)))
    assert count == 2
    assert (np.bincount(labels.ravel())[1:] > 100).all()


def test_a_thin_bent_wall_is_closed():
    outside = np.array([[0.0, 0.7], [1.303, 0.7], [1.303, 2.0]])
    inside = np.array([[1.3, 2.0], [1.3, 0.703], [0.0, 0.703]])
    free = Floor("bent", (0.0, 0.0, 2.0, 2.0), (Solid(np.vstack([outside, inside])),)).raster(0.05, 0.0, 1.0).solid == 0
    assert ndimage.label(free, structure=np.ones((3, 3)))[1] == 2


def test_a_solid_smaller_than_a_cell_leaves_a_mark():
    raster = Floor("leg", (0.0, 0.0, 1.0, 1.0), (Solid(rectangle(0.501, 0.501, 0.004, 0.004)),)).raster(0.05, 0.0, 1.0)
    assert (raster.solid == 0).sum() == 20 * 20 - 1


def test_the_laser_sees_what_cuts_its_plane_and_the_body_touches_what_cuts_its_height():
    table = Solid(rectangle(0.5, 0.5, 0.5, 0.5), 0.7, 0.75)
    floor = Floor("table", (0.0, 0.0, 2.0, 2.0), (table,))
    free = 40 * 40
    assert (floor.raster(0.05, 0.2, 0.2).solid == 0).sum() == free
    assert (floor.raster(0.05, 0.0, 0.7).solid == 0).sum() == free
    assert (floor.raster(0.05, 0.0, 1.0).solid == 0).sum() == free - 100
    assert (floor.raster(0.05, 0.72, 0.72).solid == 0).sum() == free - 100


def test_a_floor_of_cells_gives_back_its_own_cells():
    solid = (np.random.default_rng(3).random((40, 56)) < 0.3).astype(np.uint8)
    floor = Floor("image", (1.0, 2.0, 3.8, 4.0), cells=Raster(solid, (1.0, 2.0), 0.05))
    raster = floor.raster(0.05, 0.0, 1.0)
    np.testing.assert_array_equal(raster.solid[2:42, 2:58], solid)
    finer = floor.raster(0.025, 0.0, 1.0)
    np.testing.assert_array_equal(finer.solid[4:84, 4:116], np.kron(solid, np.ones((2, 2))))


def test_outside_of_an_image_is_solid():
    floor = Floor("image", (0.0, 0.0, 2.0, 2.0), cells=Raster(np.zeros((10, 10), np.uint8), (0.5, 0.5), 0.1))
    assert (floor.raster(0.1, 0.0, 1.0).solid == 0).sum() == 100


def test_a_raster_too_large_for_memory_is_refused_with_the_resolution_that_fits():
    floor = Floor("campus", (0.0, 0.0, 1000.0, 1000.0))
    with pytest.raises(
        ValueError, match=r"campus.* cells at 0.025 m, more than 200000000; a resolution of 0.\d+ m fits"
    ):
        floor.raster(0.025, 0.0, 1.0)


@pytest.mark.parametrize("resolution", [0.0, -0.1, math.nan, math.inf])
def test_a_resolution_that_is_not_positive_is_refused(resolution):
    with pytest.raises(ValueError, match="resolution is"):
        Floor("hall", (0.0, 0.0, 1.0, 1.0)).raster(resolution, 0.0, 1.0)


def test_a_height_range_upside_down_is_refused():
    with pytest.raises(ValueError, match="height range"):
        Floor("hall", (0.0, 0.0, 1.0, 1.0)).raster(0.1, 1.0, 0.0)


@pytest.mark.parametrize(
    "bounds",
    [(0.0, 0.0, 0.0, 1.0), (0.0, 1.0, 1.0, 0.0), (0.0, 0.0, math.inf, 1.0), (math.nan, 0.0, 1.0, 1.0)],
)
def test_bounds_without_size_are_refused(bounds):
    with pytest.raises(ValueError, match="bounds"):
        Floor("flat", bounds)


def test_solids_and_cells_at_once_are_refused():
    cells = Raster(np.zeros((4, 4), np.uint8), (0.0, 0.0), 0.1)
    with pytest.raises(ValueError, match="one or the other"):
        Floor("both", (0.0, 0.0, 1.0, 1.0), (Solid(rectangle(0.0, 0.0, 1.0, 1.0)),), cells)


def test_starts_and_goals_of_a_wrong_shape_are_refused():
    with pytest.raises(ValueError, match="starts"):
        Floor("hall", (0.0, 0.0, 1.0, 1.0), starts=np.zeros((2, 2)))
    with pytest.raises(ValueError, match="goal"):
        Floor("hall", (0.0, 0.0, 1.0, 1.0), goal=(math.nan, 0.0))


def test_a_solid_needs_three_corners_and_a_height():
    with pytest.raises(ValueError, match="at least 3"):
        Solid(np.zeros((2, 2)))
    with pytest.raises(ValueError, match="no height"):
        Solid(rectangle(0.0, 0.0, 1.0, 1.0), 1.0, 1.0)


def test_the_hash_is_of_what_stands_there_and_stays_the_same():
    def floor(name="a", shift=0.0, **more):
        return Floor(name, (0.0, 0.0, 3.0, 3.0), (Solid(rectangle(1.0 + shift, 1.0, 0.1, 1.0)),), **more)

    assert floor().sha256 == floor("b").sha256 == floor(shift=1e-9).sha256
    others = [
        floor(shift=0.001),
        floor(goal=(1.0, 1.0)),
        floor(starts=np.zeros((1, 3))),
        Floor("a", (0.0, 0.0, 3.0, 3.0)),
    ]
    assert len({one.sha256 for one in [floor(), *others]}) == 5
    assert floor().sha256 == "b236adf4bae3db9b101d33274b7ec1aab6ed3d2e38e3ca01e271accf74793f78"


def test_a_floor_keeps_its_corners_and_starts_whatever_becomes_of_the_given_ones():
    wall, starts = np.array(rectangle(1.0, 1.0, 0.1, 1.0)), np.zeros((1, 3))
    floor = Floor("a", (0.0, 0.0, 3.0, 3.0), (Solid(wall),), starts=starts)
    wall += 1.0
    starts += 1.0
    np.testing.assert_array_equal(floor.solids[0].polygon, rectangle(1.0, 1.0, 0.1, 1.0))
    np.testing.assert_array_equal(floor.starts, np.zeros((1, 3)))
    with pytest.raises(ValueError, match="read-only"):
        floor.starts[0, 2] = 1.0
