"""What a process holds after a thousand resets, measured where no other test has been."""

import gc
import math
import sys
from pathlib import Path

import numpy as np

import lidarium
from lidarium.envs.floors.floor import Floor
from lidarium.envs.settings.lidar import Lidar

STATUS = Path("/proc/self/statm")
CLOSET = Floor("closet", (0.0, 0.0, 2.0, 1.6))
FEW = {
    "lidar": Lidar(beams=12, field_of_view=2.0 * math.pi, range_max=3.0),
    "observe": ["scan", "pose"],
    "robots": 1,
    "threads": 1,
}


def memory():
    """Blocks that Python holds, and pages that the process holds, which is also what kernels allocate.

    Without the names of attributes that the interpreter's method cache keeps: extension modules that look an
    attribute up by a C string make its name anew each time, and the cache fills its 4,096 entries with them
    by chance, some hundreds in a thousand resets."""
    gc.collect()
    sys._clear_type_cache()
    return np.array([sys.getallocatedblocks(), int(STATUS.read_text().split()[1])])


def growth(level):
    """Return by how many blocks and bytes a thousand resets have grown a process, and bytes of a map."""
    batch = lidarium.vector_env(1, CLOSET, level=level, **FEW, starts="fixed")
    action = batch.action_space.sample()

    def reset(times):
        for _ in range(times):
            batch.reset()
            batch.step(action)

    reset(200)
    before = memory()
    reset(1_000)
    blocks, pages = memory() - before
    return int(blocks), int(pages) * 4096, batch.engine.simulation.beliefs.log_odds[0].nbytes
