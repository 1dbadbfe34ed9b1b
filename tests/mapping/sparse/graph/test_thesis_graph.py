"""The graph as the thesis has it."""

import numpy as np
import pytest

from lidarium.mapping.sparse.graph.thesis_graph import ThesisGraphSettings, build_thesis_graph


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
