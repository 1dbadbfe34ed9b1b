"""A thousand resets hold no more memory than a few."""

import pytest
from held_memory import STATUS, growth

from lidarium.evaluation.processes import shared_out


@pytest.mark.skipif(not STATUS.exists(), reason="the memory of a process is read from /proc")
@pytest.mark.parametrize("level", ["velocity", "frontier"])
def test_memory_does_not_grow_with_the_number_of_resets(level):
    ((_, grown),) = shared_out(growth, [level], 1, is_apart=True)
    blocks, held_bytes, map_bytes = grown
    # Fewer than one for every twenty resets.
    assert blocks < 50
    # Less than a map of the closet for each reset.
    assert held_bytes < 1_000 * map_bytes
