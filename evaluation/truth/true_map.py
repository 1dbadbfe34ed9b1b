"""Ground truth of a floor, on the lattice of the robots' maps.

The scorer's masks lie on it, too.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.floors.floor import Raster
from lidarium.envs.floors.free_space import reachable_free_space
from lidarium.envs.simulation.coverage import unpack_bits
from lidarium.envs.simulation.disturbances.odometry import RADIUS
from lidarium.envs.simulation.people.doors import with_shut_doors
from lidarium.envs.simulation.score import counted_cells
from lidarium.evaluation.metrics.cells import Mask, surface


@dataclass(frozen=True, slots=True, eq=False)
class Truth:
    """Cells of a floor, each (rows, columns) bool.

    Attributes
    ----------
    occupied : Mask
        Cells of which any of the world's cells is solid in the laser's plane.
    counted : Mask
        F: free cells that the smallest robot's disc sweeps over its configuration space, connected to the
        starts.
    knowable : Mask
        Cells that a sensor that fits everywhere could know: free cells connected to a start through free
        cells, and the occupied cells 8-adjacent to them. The rest, the inside of solids, sealed rooms and all
        that lies outside, is unknown in a perfect map.
    valid : Mask
        F and the occupied cells 8-adjacent to it.
    """

    occupied: Mask
    counted: Mask
    knowable: Mask
    valid: Mask


def truth_of(env: ExplorationEnv) -> Truth:
    """Return the ground truth of the floor of an episode, after its reset."""
    occupied = occupied_in_truth(env)
    counted = unpack_bits(env.score.counted_masks[0], occupied.shape[1])
    free = _connected_free(env, occupied)
    return Truth(occupied, counted, free | surface(occupied, free), counted | surface(occupied, counted))


def left_by_failed(env: ExplorationEnv) -> Mask | None:
    """Return the part of F that the others can reach past failed robots' bodies.

    They reach it from their current positions.

    None if none has failed, or all have.
    """
    world, tables = env.world, env.world.floors[0]
    failed = world.failed.astype(np.bool_)
    if tables is None or not failed.any() or failed.all():
        return None
    body, resolution = tables.body, tables.body.resolution
    solid = body.solid.copy()
    rows, columns = np.indices(solid.shape)
    for x, y, _ in world.poses[failed]:
        # A cell less than the body: a robot that touches it still fits next to it.
        near = np.hypot(
            body.origin[0] + (columns + 0.5) * resolution - x, body.origin[1] + (rows + 0.5) * resolution - y
        )
        solid[near < env.settings.robot.radius - resolution] = 1
    reachable = reachable_free_space(
        Raster(solid, body.origin, resolution), float(world.bodies[:, RADIUS].min()), world.poses[~failed]
    )
    free = reachable & (tables.laser.solid == 0)
    left = counted_cells(free, round(env.settings.occupancy.resolution / resolution))
    counted = unpack_bits(env.score.counted_masks[0], left.shape[1])
    return np.asarray(left & counted)


def occupied_in_truth(env: ExplorationEnv) -> NDArray[np.bool_]:
    """Return the true occupied cells on the lattice of the maps.

    A cell is occupied if any of the world's cells in it is solid, and free beyond the world's raster.
    """
    tables = env.world.floors[0]
    assert tables is not None
    raster, population = tables.laser, env.simulation.population
    if population is not None:
        raster = with_shut_doors(raster, population.doors_of(0))
    multiple = round(env.settings.occupancy.resolution / raster.resolution)
    rows, words = env.score.counted_masks[0].shape
    solid = np.zeros((rows * multiple, words * 64 * multiple), np.bool_)
    solid[: raster.solid.shape[0], : raster.solid.shape[1]] = raster.solid
    if multiple == 1:
        return solid
    return np.asarray(solid.reshape(rows, multiple, words * 64, multiple).any(axis=(1, 3)))


def _connected_free(env: ExplorationEnv, occupied: Mask) -> Mask:
    """Return the free cells that are 4-connected to the cell of a start."""
    tables = env.world.floors[0]
    assert tables is not None
    reached, resolution = 2, env.settings.occupancy.resolution
    cells = occupied.astype(np.uint8)
    for x, y, _ in env.world.starts:
        column, row = (
            int((value - corner) / resolution) for value, corner in zip((x, y), tables.laser.origin, strict=True)
        )
        if cells[row, column] == 0:
            cv2.floodFill(cells, None, (column, row), (float(reached),), flags=4)
    return np.asarray(cells == reached)
