"""Points beside a place, by voxels."""

import numpy as np
import pytest

from lidarium.mapping.sparse.thesis_graph import (
    NEIGHBOURHOODS,
    KdTreeIndex,
    ThesisGraphSettings,
    VoxelIndex,
    build_thesis_graph,
)


@pytest.mark.parametrize("neighbours", NEIGHBOURHOODS)
def test_voxels_beside_a_place_have_the_points_of_a_plain_search(neighbours):
    generator = np.random.default_rng(2)
    points, size = generator.uniform(-1.0, 2.0, (400, 3)), np.array([0.5, 0.4, 0.3])
    index = VoxelIndex(points, size)
    cells = np.floor((points - points.min(axis=0)) / size).astype(int)
    for query in generator.uniform(-1.5, 2.5, (40, 3)):
        own = index.voxel(query)
        offsets = np.vstack([NEIGHBOURHOODS[neighbours], [(0, 0, 0)]])
        wanted = (cells[:, None] == own + offsets).all(axis=2).any(axis=1)
        assert index.beside(query, neighbours).tolist() == np.flatnonzero(wanted).tolist()


def test_neighbourhoods_that_are_none_are_refused():
    with pytest.raises(ValueError, match="neighbours is 5"):
        VoxelIndex(np.zeros((1, 3))).beside(np.zeros(3), 5)
    with pytest.raises(ValueError, match="size of voxels"):
        VoxelIndex(np.zeros((1, 3)), 0.0)


@pytest.mark.parametrize("make", [VoxelIndex, KdTreeIndex])
def test_points_within_a_ball_are_those_of_a_plain_search(make):
    generator = np.random.default_rng(3)
    points = generator.uniform(-1.0, 2.0, (400, 3))
    index = make(points)
    for query in generator.uniform(-2.5, 3.5, (40, 3)):
        for radius in (0.1, 0.6, 2.0):
            wanted = np.flatnonzero(np.linalg.norm(points - query, axis=1) <= radius)
            assert index.within(query, radius).tolist() == wanted.tolist()


def test_the_thesis_graph_is_the_same_with_every_support():
    generator = np.random.default_rng(4)
    free = np.column_stack([generator.uniform(0.0, 4.0, (300, 2)), generator.uniform(0.0, 0.05, 300)])
    occupied = generator.uniform([0.0, 0.0, 0.1], [4.0, 4.0, 1.0], (60, 3))
    plain = build_thesis_graph(free, occupied, ThesisGraphSettings(support="none", height=0.5))
    assert len(plain.edges) > 20
    for support in ("voxels", "kd_tree"):
        found = build_thesis_graph(free, occupied, ThesisGraphSettings(support=support, height=0.5))
        assert np.array_equal(found.edges, plain.edges)
    with pytest.raises(ValueError, match="support of the thesis's graph is 'octree'"):
        ThesisGraphSettings(support="octree")
