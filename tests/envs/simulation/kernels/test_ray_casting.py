"""Both ray casters against a slow traversal of the cells, on every kind of floor and in every awkward
direction."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lidarium.envs.settings.lidar import Lidar
from lidarium.envs.simulation.kernels.face_casting import FaceTable, cast_by_faces
from lidarium.envs.simulation.kernels.ray_casting import cast_scan, cast_scans, cut_by_disc
from lidarium.envs.simulation.kernels.ray_tables import RayTables
from lidarium.envs.simulation.kernels.ray_travel import cast_by_squares, cast_in_lanes, cast_one_by_one
from lidarium.mapping.grids.scan_geometry import Beams, ScanGeometry, beam_directions

TENTH_OF_A_MILLIMETRE = 1e-4 / 0.025
"""In cells of a raster of 2.5 cm."""

CORNER = 5e-9
"""A ray that passes a lattice corner nearer than this may go either way [cells]."""


def reach_bounds(solid, x, y, dx, dy, reach):
    """Least and greatest range [cells] that a ray may have, cell by cell: they differ where it runs along
    or through a corner."""
    lower = math.inf
    columns, rows = _lanes(x, dx), _lanes(y, dy)
    step_x, step_y = (1 if dx > 0.0 else -1), (1 if dy > 0.0 else -1)
    distance = 0.0
    for _ in range(10_000):
        states = [solid[row, column] != 0 for row in rows for column in columns]
        if any(states):
            lower = min(lower, distance)
        if all(states):
            return min(lower, reach), min(distance, reach)
        if distance >= reach:
            return min(lower, reach), reach
        next_x, next_y = _crossing(columns, x, dx, step_x), _crossing(rows, y, dy, step_y)
        offset = (
            abs(next_x - next_y) * min(abs(dx), abs(dy))
            if math.isfinite(next_x) and math.isfinite(next_y)
            else math.inf
        )
        if offset < CORNER:
            distance = max(next_x, next_y)
            sides = [solid[rows[0], columns[0] + step_x] != 0, solid[rows[0] + step_y, columns[0]] != 0]
            if any(sides):
                lower = min(lower, min(next_x, next_y))
            if all(sides):
                return min(lower, reach), min(distance, reach)
            columns, rows = [columns[0] + step_x], [rows[0] + step_y]
        elif next_x < next_y:
            distance, columns = next_x, [columns[0] + step_x]
        else:
            distance, rows = next_y, [rows[0] + step_y]
    raise AssertionError("the reference did not end")


def _lanes(position, direction):
    """Cells beside each other in which the ray begins: two where it runs along a lattice line, or starts
    on one."""
    cell = math.floor(position)
    if abs(position - round(position)) < 1e-9 and abs(direction) < 1e-12:
        return [round(position) - 1, round(position)]
    if position == cell and direction < 0.0:
        return [cell - 1]
    return [cell]


def _crossing(lanes, position, direction, step):
    if abs(direction) < 1e-12:
        return math.inf
    return (lanes[0] + (1 if step > 0 else 0) - position) / direction


def walled(rows, columns):
    solid = np.zeros((rows, columns), np.uint8)
    solid[0], solid[-1], solid[:, 0], solid[:, -1] = 1, 1, 1, 1
    return solid


def rooms(generator, rows=150, columns=180):
    solid = walled(rows, columns)
    for _ in range(8):
        row, column = generator.integers(2, rows - 6), generator.integers(2, columns - 6)
        height, width = (int(generator.integers(2, 60)), int(generator.integers(1, 4)))[
            :: generator.choice([-1, 1])
        ]
        solid[row : row + height, column : column + width] = 1
    return solid


def turned(generator, rows=150, columns=180):
    """Walls turned by any angle, as stairs of cells that touch along sides."""
    solid = walled(rows, columns)
    for _ in range(5):
        angle, thickness = generator.uniform(0.0, math.pi), generator.uniform(1.5, 4.0)
        cx, cy, length = (
            generator.uniform(20, columns - 20),
            generator.uniform(20, rows - 20),
            generator.uniform(10, 50),
        )
        j, i = np.meshgrid(np.arange(columns) + 0.5 - cx, np.arange(rows) + 0.5 - cy)
        along, across = j * math.cos(angle) + i * math.sin(angle), -j * math.sin(angle) + i * math.cos(angle)
        solid[(abs(along) < length / 2) & (abs(across) < thickness / 2)] = 1
    return solid


def speckled(generator, rows=90, columns=100):
    return walled(rows, columns) | (
        generator.random((rows, columns)) < generator.choice([0.003, 0.02, 0.1])
    ).astype(np.uint8)


FLOORS = {"rooms": rooms, "turned": turned, "speckled": speckled}


def free_position(solid, generator):
    i, j = (int(value) for value in generator.choice(np.argwhere(solid == 0)))
    return j + generator.uniform(0.001, 0.999), i + generator.uniform(0.001, 0.999)


def directions_of(geometry, heading):
    directions = np.empty((4, geometry.beams))
    beam_directions(heading, geometry.unit_vectors, directions)
    return directions


def beams_of(x, y, heading, geometry, directions, reach):
    return Beams(x, y, heading, geometry.angle_first, geometry.angle_increment, directions, reach)


def by_squares(tables, beams):
    ranges = np.full(beams.directions.shape[1], np.nan)
    cast_by_squares(tables.squares.ravel(), tables.rows, tables.columns, beams, ranges)
    return ranges


def by_faces(tables, beams):
    ranges = np.full(beams.directions.shape[1], np.nan)
    tile_rows, tile_columns = -(-tables.rows // 128), tables.tile_columns
    window = (0, tile_rows - 1, 0, tile_columns - 1)
    cast_by_faces(FaceTable(tables.faces, tables.face_starts, tile_columns), window, beams, ranges)
    return ranges


def by_choice(tables, beams):
    ranges = np.full(beams.directions.shape[1], np.nan)
    cast_scan(tables.addresses, beams, ranges)
    return ranges


def all_casts(tables, x, y, heading, geometry, reach):
    directions = directions_of(geometry, heading)
    beams = beams_of(x, y, heading, geometry, directions, reach)
    return directions, (by_squares(tables, beams), by_faces(tables, beams), by_choice(tables, beams))


def check_against_reference(solid, tables, x, y, heading, geometry, reach):
    directions, casts = all_casts(tables, x, y, heading, geometry, reach)
    bounds = np.array(
        [reach_bounds(solid, x, y, directions[0, k], directions[1, k], reach) for k in range(geometry.beams)]
    )
    for ranges in casts:
        assert (ranges >= bounds[:, 0] - TENTH_OF_A_MILLIMETRE).all()
        assert (ranges <= bounds[:, 1] + TENTH_OF_A_MILLIMETRE).all()
    return casts, bounds


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


def test_the_casters_agree_with_each_other_on_real_sizes():
    generator = np.random.default_rng(5)
    solid = turned(generator, 400, 500)
    tables = RayTables(solid)
    geometry = ScanGeometry()
    for _ in range(20):
        x, y = free_position(solid, generator)
        _, (squares, faces, chosen) = all_casts(
            tables, x, y, generator.uniform(-math.pi, math.pi), geometry, 224.0
        )
        assert np.abs(squares - faces).max() < 1e-6
        assert np.abs(squares - chosen).max() < 1e-6


@pytest.mark.parametrize("kind", FLOORS)
@pytest.mark.parametrize("beams", [32, 33, 48, 63, 121, 720])
@pytest.mark.parametrize("view", [0.3, math.radians(240.0), 2.0 * math.pi])
def test_beams_in_lanes_are_those_cast_one_by_one_to_the_bit(kind, beams, view):
    generator = np.random.default_rng([beams, len(kind)])
    tables = RayTables(FLOORS[kind](generator))
    geometry = ScanGeometry(beams=beams, field_of_view=view)
    free = np.argwhere(tables.squares[0] > 0)
    for reach in (3.0, 40.0, 300.0):
        row, column = generator.choice(free)
        for x, y, heading in [
            (column + generator.random(), row + generator.random(), generator.uniform(-4.0, 4.0)),
            (column + 0.5, row + 0.5, math.pi / 4),
            (float(column), float(row), math.pi / 2),
        ]:
            cast = beams_of(x, y, heading, geometry, directions_of(geometry, heading), reach)
            both = []
            for caster in (cast_in_lanes, cast_one_by_one):
                ranges = np.full(beams, np.nan)
                caster(tables.squares.ravel(), tables.rows, tables.columns, cast, ranges)
                both.append(ranges.tolist())
            assert both[0] == both[1]


def test_nothing_in_reach_gives_the_reach_itself():
    tables = RayTables(walled(400, 400))
    geometry = ScanGeometry(beams=90, field_of_view=2.0 * math.pi)
    _, casts = all_casts(tables, 200.3, 199.7, 0.4, geometry, 150.0)
    for ranges in casts:
        assert (ranges == 150.0).all()


@pytest.mark.parametrize("fixed", [0, 1])
def test_a_hall_longer_than_the_largest_square_is_crossed_exactly(fixed):
    solid = walled(12, 1500) if fixed else walled(1500, 12)
    tables = RayTables(solid)
    x, y = (3.5, 6.5) if fixed else (6.5, 3.5)
    heading = 0.001 if fixed else math.pi / 2 + 0.001
    check_against_reference(solid, tables, x, y, heading, ScanGeometry(beams=9, field_of_view=0.01), 5000.0)


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
