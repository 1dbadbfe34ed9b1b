"""The octomap library's map, projected as the thesis's baseline has it."""

import importlib.util

import numpy as np
import pytest
from scipy import ndimage

from lidarium.benchmarks.studies.sparse.grids import OctoMap
from lidarium.benchmarks.studies.sparse.places import frames_of, load_place

pytestmark = pytest.mark.skipif(importlib.util.find_spec("octomap") is None, reason="octomap-python is not installed")


def test_what_frames_show_is_free_or_occupied_and_the_rest_unknown():
    place, tree = load_place("home_arena"), OctoMap()
    frames = [frame for number, frame in zip(range(8), frames_of(place), strict=False)]
    for frame in frames:
        tree.add(frame)
    sizes = tree.sizes()
    assert 0 < sizes.bits_deflated < sizes.bits < sizes.full
    grid = tree.projected(place)
    assert set(np.unique(grid.log_odds)) == {-1, 0, 1}
    truth = place.floor.raster(0.05, 0.05, 1.2).solid
    # What is occupied is a solid or a cell beside one; free cells lie in none.
    assert ndimage.binary_dilation(truth, np.ones((3, 3)))[grid.log_odds == 1].mean() > 0.97
    assert (truth[grid.log_odds == -1].mean()) < 0.1
    column, row = np.floor((frames[0].base[:2] - np.array(grid.origin)) / 0.05).astype(int)
    assert grid.log_odds[max(row - 20, 0) : row + 20, max(column - 20, 0) : column + 20].any()
