"""Obstacles that come and go."""

import numpy as np
import pytest

from lidarium.mapping.sparse.changing_graph import ChangingGraph
from lidarium.mapping.sparse.graph import GraphSettings, build_graph
from lidarium.mapping.sparse.swept_body import SweptBody, are_free, index_boxes

WALL = [[2.9, -1.0, 0.0], [3.1, 2.0, 2.5]]


TABLE = [[1.0, 3.0, 0.7], [2.2, 4.0, 0.75]]


BODY = SweptBody(radius=0.2, height=1.0)


def room(boxes=(WALL, TABLE), body=BODY, **settings):
    generator = np.random.default_rng(0)
    free = np.column_stack([generator.uniform(0.0, 6.0, (900, 2)), np.zeros(900)])
    return build_graph(free, np.array(boxes).reshape(-1, 2, 3), body, GraphSettings(**settings))


def test_repair_is_the_test_of_all_edges_and_removal_restores_every_bit():
    base = room()
    changing, generator, numbers = ChangingGraph(base), np.random.default_rng(3), []
    for _ in range(12):
        low = generator.uniform((0.0, 0.0, 0.0), (5.5, 5.5, 0.9))
        numbers.append(changing.insert(np.stack([low, low + generator.uniform(0.05, 0.8, 3)])))
        if len(numbers) > 4:
            changing.remove(numbers.pop(int(generator.integers(len(numbers)))))
        firsts = np.repeat(np.arange(len(base.nodes)), np.diff(base.starts))
        there = index_boxes(np.array(list(changing.obstacles.values())))
        is_open = are_free(there, base.nodes[firsts], base.nodes[base.ends], BODY.numbers)
        assert (np.isfinite(changing.graph.weights) == is_open).all()
        assert (~is_open).any()
    for number in numbers:
        changing.remove(number)
    assert changing.graph.weights.tobytes() == base.weights.tobytes()
    assert changing.graph.index is base.index


@pytest.mark.parametrize("box", [np.zeros(3), [[0, 0, 0], [1, -1, 1]], [[0, 0, 0], [1, 1, np.nan]]])
def test_obstacles_that_are_no_boxes_are_refused(box):
    with pytest.raises(ValueError, match="box is"):
        ChangingGraph(room()).insert(box)
