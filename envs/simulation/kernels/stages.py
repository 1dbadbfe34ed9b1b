"""The two stages of a robot's step in one kernel: its scan with the score, then its map.

Stage one senses, after all bodies have moved; stage two updates the robot's map at the pose that its
localizer believes. The fused step runs both in one call; both ways call the same functions for each robot, so
they agree to the bit. Where a robot's believed pose is the true one, its map has the floor's lattice and
ranges carry no noise, the area seen is computed once for the scorer and the map.
"""

import numpy as np

from lidarium.envs.simulation.kernels.arrays import (
    OWN_FRAME,
    TRUE_POSE,
    WorldArrays,
)
from lidarium.envs.simulation.kernels.map_updates import update_map
from lidarium.envs.simulation.kernels.masks import score_area
from lidarium.envs.simulation.kernels.scanning import ScanScratch, is_noisy, sense
from lidarium.mapping.grids.scan_geometry import beam_directions
from lidarium.mapping.kernels.compilation import kernel


@kernel(spliced=True)
def sense_and_perceive(
    world: WorldArrays, row: int, first: int, robots: int, perceives: bool, scratch: ScanScratch
) -> None:
    """Run both stages for one robot (or the first alone, where not ``perceives``).

    ``first`` is the first row of its episode.
    """
    scratch.windows[:] = np.uint64(0)
    sense(world, row, first, robots, scratch.directions, scratch.lengths)
    box = score_area(world, row, first, robots, scratch)
    if not perceives:
        return
    is_same = world.flags[row] & (TRUE_POSE | OWN_FRAME) == TRUE_POSE and not is_noisy(world.sensor)
    if not is_same:
        scratch.windows[0] = np.uint64(0)
        if world.believed[row, 2] != world.poses[row, 2]:
            beam_directions(world.believed[row, 2], world.unit_vectors, scratch.directions)
    update_map(world, row, first, robots, scratch, box, is_same)
