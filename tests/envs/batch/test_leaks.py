"""Two thousand resets hold no more memory than a few."""

import gc
import math
import sys
from pathlib import Path

import numpy as np
import pytest

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


@pytest.mark.skipif(not STATUS.exists(), reason="the memory of a process is read from /proc")
@pytest.mark.parametrize("level", ["velocity", "frontier"])
def test_memory_does_not_grow_with_the_number_of_resets(level):
    batch = lidarium.vector_env(1, CLOSET, level=level, **FEW)
    action = batch.action_space.sample()

    def reset(times):
        for _ in range(times):
            batch.reset()
            batch.step(action)

    def grown():
        before = memory()
        reset(1_000)
        return memory() - before

    reset(200)
    # A leak grows each time; what else the process takes now and then does not.
    blocks, pages = np.minimum(grown(), grown())
    # Fewer than one for every twenty resets.
    assert blocks < 50
    # Less than a map of the closet for each reset.
    assert pages * 4096 < 1_000 * batch.batch.simulation.beliefs.log_odds[0].nbytes
