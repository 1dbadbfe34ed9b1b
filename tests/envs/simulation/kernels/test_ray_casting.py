"""Both ray casters against a slow traversal of the cells, on every kind of floor and in every awkward
direction."""

import math

import numpy as np
import pytest
from cast_rays import (
    FLOORS,
    all_casts,
    beams_of,
    by_choice,
    by_faces,
    by_squares,
    check_against_reference,
    directions_of,
    free_position,
    reach_bounds,
    rooms,
    speckled,
    walled,
)
from hypothesis import given, settings
from hypothesis import strategies as st

from lidarium.envs.settings.lidar import Lidar
from lidarium.envs.simulation.kernels.ray_casting import cast_scans, cut_by_disc
from lidarium.envs.simulation.kernels.ray_tables import RayTables
from lidarium.mapping.grids.scan_geometry import ScanGeometry


@pytest.mark.parametrize("kind", FLOORS)
@pytest.mark.parametrize("seed", range(6))
def test_both_casters_agree_with_the_slow_traversal_to_a_tenth_of_a_millimetre(kind, seed):
    generator = np.random.default_rng([seed, len(kind)])
    solid = FLOORS[kind](generator)
    tables = RayTables(solid)
    geometry = ScanGeometry(beams=121, field_of_view=generator.choice([math.radians(240.0), 2.0 * math.pi]))
    for _ in range(4):
        x, y = free_position(solid, generator)
        check_against_reference(
            solid,
            tables,
            x,
            y,
            generator.uniform(-math.pi, math.pi),
            geometry,
            generator.choice([30.0, 224.0, 2000.0]),
        )


@given(
    seed=st.integers(0, 2**32 - 1),
    beams=st.sampled_from([1, 31, 64, 200]),
    view=st.sampled_from([0.3, math.radians(240.0), 2.0 * math.pi]),
)
@settings(max_examples=60)
def test_no_random_floor_and_pose_tells_the_casters_from_the_reference(seed, beams, view):
    generator = np.random.default_rng(seed)
    solid = speckled(generator, 40, 50)
    geometry = ScanGeometry(beams=beams, field_of_view=view)
    x, y = free_position(solid, generator)
    check_against_reference(solid, RayTables(solid), x, y, generator.uniform(-10.0, 10.0), geometry, 300.0)


@pytest.mark.parametrize("heading", [k * math.pi / 4 for k in range(-4, 5)])
def test_rays_along_walls_and_parallel_to_the_axes_are_exact(heading):
    solid = walled(40, 60)
    solid[10:12, 5:50], solid[20:35, 30:32] = 1, 1
    tables = RayTables(solid)
    geometry = ScanGeometry(beams=8, field_of_view=2.0 * math.pi)
    close_by = [(20.5, 12.0 + 1e-7), (32.0 + 1e-7, 25.5), (30.0 - 1e-7, 25.5), (5.0, 10.0 - 1e-6)]
    in_line_with_faces = [(51.0, 12.0), (32.0, 15.0), (50.0, 18.0), (4.0, 10.0), (30.0, 37.0)]
    for x, y in [*close_by, *in_line_with_faces, (20.0, 15.0), (33.0, 15.5), (20.5, 12.25)]:
        check_against_reference(solid, tables, x, y, heading, geometry, 500.0)


@pytest.mark.parametrize("axis", [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)])
def test_a_ray_exactly_parallel_to_an_axis_reaches_the_wall_ahead_exactly(axis):
    solid = walled(30, 50)
    tables = RayTables(solid)
    geometry = ScanGeometry(beams=1)
    with np.errstate(divide="ignore"):
        directions = np.array(
            [
                [axis[0]],
                [axis[1]],
                [1.0 / axis[0] if axis[0] else math.inf],
                [1.0 / axis[1] if axis[1] else math.inf],
            ]
        )
    x, y = 20.25, 13.5
    expected = {(1.0, 0.0): 49 - x, (0.0, 1.0): 29 - y, (-1.0, 0.0): x - 1, (0.0, -1.0): y - 1}[axis]
    heading = math.atan2(axis[1], axis[0])
    beams = beams_of(x, y, heading, geometry, directions, 500.0)
    assert by_squares(tables, beams)[0] == expected
    assert by_faces(tables, beams)[0] == expected


@pytest.mark.parametrize("slope", [(1, 1), (1, 2), (2, 1), (3, 4), (5, 1), (1, 7)])
def test_rays_through_lattice_corners_end_and_never_leak_through_a_wall_of_cells_that_touch_by_sides(slope):
    rows = columns = 61
    solid = walled(rows, columns)
    for k in range(5, 55):
        # A stair from the upper left to the lower right, each cell sharing a side with the next.
        solid[rows - 1 - k, k], solid[rows - 2 - k, k] = 1, 1
    tables = RayTables(solid)
    norm = math.hypot(*slope)
    geometry = ScanGeometry(beams=1)
    for sign_x, sign_y in [(1, 1), (-1, -1), (1, -1), (-1, 1)]:
        dx, dy = sign_x * slope[0] / norm, sign_y * slope[1] / norm
        directions = np.array([[dx], [dy], [1.0 / dx], [1.0 / dy]])
        for x in range(6, 55, 3):
            for y in range(6, 55, 5):
                if solid[y - 1 : y + 1, x - 1 : x + 1].any():
                    continue
                low, high = reach_bounds(solid, float(x), float(y), dx, dy, 200.0)
                beams = beams_of(float(x), float(y), math.atan2(dy, dx), geometry, directions, 200.0)
                cast, drawn = by_squares(tables, beams)[0], by_faces(tables, beams)[0]
                assert low - 1e-6 <= cast <= high + 1e-6
                assert low - 1e-6 <= drawn <= high + 1e-6


@given(
    x=st.integers(2, 58),
    y=st.integers(2, 38),
    dx=st.integers(-12, 12),
    dy=st.integers(-12, 12),
    seed=st.integers(0, 50),
)
@settings(max_examples=150)
def test_rays_from_lattice_points_through_lattice_points_never_hang_or_leak(x, y, dx, dy, seed):
    if dx == 0 and dy == 0:
        return
    generator = np.random.default_rng(seed)
    solid = speckled(generator, 40, 60)
    solid[y - 1 : y + 1, x - 1 : x + 1] = 0
    solid[0], solid[-1], solid[:, 0], solid[:, -1] = 1, 1, 1, 1
    tables = RayTables(solid)
    norm = math.hypot(dx, dy)
    unit = (dx / norm, dy / norm)
    directions = np.array(
        [[unit[0]], [unit[1]], [1.0 / unit[0] if dx else math.inf], [1.0 / unit[1] if dy else math.inf]]
    )
    low, high = reach_bounds(solid, float(x), float(y), *unit, 300.0)
    beams = beams_of(float(x), float(y), math.atan2(dy, dx), ScanGeometry(beams=1), directions, 300.0)
    assert low - 1e-6 <= by_squares(tables, beams)[0] <= high + 1e-6
    drawn = by_faces(tables, beams)[0]
    # Standing on a face itself the drawn faces let it be; no body can stand there.
    assert drawn >= low - 1e-6
    assert drawn <= high + 1e-6 or low == 0.0


def test_nothing_in_reach_gives_the_reach_itself():
    tables = RayTables(walled(400, 400))
    geometry = ScanGeometry(beams=90, field_of_view=2.0 * math.pi)
    _, casts = all_casts(tables, 200.3, 199.7, 0.4, geometry, 150.0)
    for ranges in casts:
        assert (ranges == 150.0).all()


def test_a_lidar_of_one_beam_looks_straight_ahead():
    solid = walled(60, 80)
    tables = RayTables(solid)
    lidar = Lidar(beams=1)
    assert lidar.angles.tolist() == [0.0]
    _, casts = all_casts(tables, 40.5, 30.5, math.pi / 2, lidar, 224.0)
    assert all(abs(float(ranges[0]) - 28.5) < 1e-9 for ranges in casts)


def test_many_poses_in_one_call_are_the_scans_of_the_single_poses():
    generator = np.random.default_rng(3)
    solid = rooms(generator)
    tables, geometry = RayTables(solid), ScanGeometry(beams=60)
    poses = np.array([[*free_position(solid, generator), generator.uniform(-3.0, 3.0)] for _ in range(5)])
    ranges = np.empty((5, 60))
    cast_scans(
        tables.addresses,
        poses,
        geometry.unit_vectors,
        geometry.angle_first,
        geometry.angle_increment,
        224.0,
        ranges,
    )
    for pose, row in zip(poses, ranges, strict=True):
        beams = beams_of(*pose, geometry, directions_of(geometry, pose[2]), 224.0)
        assert np.array_equal(row, by_choice(tables, beams))


def disc_ranges(directions, offset, radius, reach):
    middle = offset[0] * directions[0] + offset[1] * directions[1]
    inside = middle**2 - (offset @ offset - radius**2)
    meets = (inside >= 0.0) & (middle > 0.0)
    return np.where(meets, np.minimum(reach, middle - np.sqrt(np.maximum(inside, 0.0))), reach)


@given(
    angle=st.floats(-math.pi, math.pi),
    distance=st.floats(0.5, 60.0),
    radius=st.floats(0.1, 12.0),
    heading=st.floats(-7.0, 7.0),
    beams=st.sampled_from([1, 2, 37, 360]),
    view=st.sampled_from([math.radians(90.0), math.radians(240.0), 2.0 * math.pi]),
)
@settings(max_examples=150)
def test_a_disc_cuts_exactly_the_beams_that_meet_it(angle, distance, radius, heading, beams, view):
    if distance <= radius * 1.001:
        return
    geometry = ScanGeometry(beams=beams, field_of_view=view)
    directions = directions_of(geometry, heading)
    offset = np.array([distance * math.cos(angle), distance * math.sin(angle)])
    ranges = np.full(beams, 50.0)
    cast = beams_of(10.0, 20.0, heading, geometry, directions, 50.0)
    cut_by_disc(cast, 10.0 + offset[0], 20.0 + offset[1], radius, ranges)
    expected = disc_ranges(directions, offset, radius, 50.0)
    grazing = abs(np.abs(offset[1] * directions[0] - offset[0] * directions[1]) - radius) < 1e-6
    assert np.abs(ranges - expected)[~grazing].max(initial=0.0) < 1e-6


def test_a_disc_never_lengthens_a_beam_and_one_around_the_laser_is_not_seen():
    geometry = ScanGeometry(beams=90, field_of_view=2.0 * math.pi)
    directions, ranges = directions_of(geometry, 0.3), np.full(90, 2.0)
    beams = beams_of(0.0, 0.0, 0.3, geometry, directions, 50.0)
    cut_by_disc(beams, 10.0, 0.0, 3.0, ranges)
    assert (ranges == 2.0).all()
    cut_by_disc(beams, 1.0, 0.0, 3.0, ranges)
    assert (ranges == 2.0).all()
