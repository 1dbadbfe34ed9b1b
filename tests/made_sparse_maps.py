"""Sparse maps of drawn boxes and free codes, for tests of their files."""

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from lidarium.mapping.sparse.floor_plane import FloorPlane
from lidarium.mapping.sparse.settings import FloorSettings, MapperSettings
from lidarium.mapping.sparse.sparse_map import SparseMap, free_codes, occupied_codes

COORDINATES = st.floats(-1e4, 1e4, allow_nan=False)
TRIPLES = arrays(np.float64, st.tuples(st.integers(0, 20), st.just(3)), elements=COORDINATES)
SETTINGS = MapperSettings(split="both", seed=7, floor=FloorSettings(up_y=-1.0, up_z=0.0))


def some_map(count=60, seed=0):
    rng = np.random.default_rng(seed)
    low = rng.uniform(-4.0, 4.0, (count, 3))
    return SparseMap(
        occupied=occupied_codes(np.stack([low, low + rng.uniform(0.0, 0.6, (count, 3))], axis=1)),
        ground=free_codes(rng.uniform(-4.0, 4.0, (count // 2, 3)) * [1, 1, 0.01]),
        floor=FloorPlane(0.6, 0.0, 0.8, 0.3),
        settings=SETTINGS,
    )
