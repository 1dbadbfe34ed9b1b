import numpy as np

from lidarium.mapping.files.map_files import FREE, OCCUPIED
from lidarium.mapping.merging.description.resampling import resampled


def test_coarser_cells_keep_thin_walls():
    levels = np.full((40, 40), FREE, np.uint8)
    levels[:, 17] = OCCUPIED
    coarse = resampled(levels, 0.025, 0.1)
    assert coarse.shape == (10, 10)
    assert (coarse[:, 4] == OCCUPIED).all()
    assert (np.delete(coarse, 4, axis=1) == FREE).all()
    assert resampled(levels, 0.1, 0.1) is levels
