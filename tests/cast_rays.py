"""Rays cast by all casters, and by a slow traversal of the cells."""

import math

import numpy as np

from lidarium.envs.simulation.kernels.face_casting import FaceTable, cast_by_faces
from lidarium.envs.simulation.kernels.ray_casting import cast_by_squares, cast_scan
from lidarium.mapping.grids.scan_geometry import Beams, beam_directions

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
        height, width = (int(generator.integers(2, 60)), int(generator.integers(1, 4)))[:: generator.choice([-1, 1])]
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
    return walled(rows, columns) | (generator.random((rows, columns)) < generator.choice([0.003, 0.02, 0.1])).astype(
        np.uint8
    )


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
