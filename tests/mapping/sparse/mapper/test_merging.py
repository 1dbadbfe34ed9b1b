"""Boxes merge where their union adds nothing."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from lidarium.mapping.sparse.mapper.explained_points import are_covered
from lidarium.mapping.sparse.mapper.merging import MOST_SLACK_M, merged_boxes

NOTHING_FREE = np.empty((0, 3))


def random_boxes(count, seed, extent=3.0):
    rng = np.random.default_rng(seed)
    low = rng.uniform(0.0, extent, (count, 3)) * [1.0, 1.0, 0.3]
    return np.stack([low, low + rng.uniform(0.0, 0.5, (count, 3))], axis=1)


def lies_over(boxes, nodes):
    return (
        ((nodes[:, None, :2] >= boxes[None, :, 0, :2]) & (nodes[:, None, :2] <= boxes[None, :, 1, :2]))
        .all(axis=2)
        .any(axis=1)
    )


def test_a_box_within_another_goes():
    boxes = np.array([[[0.0, 0, 0], [1, 1, 1]], [[0.2, 0.2, 0.2], [0.4, 0.4, 0.4]]])
    merged, labels = merged_boxes(boxes, NOTHING_FREE, 0.0, 100)
    assert merged.tolist() == boxes[:1].tolist()
    assert labels.tolist() == [0, 0]


def test_pieces_of_a_wall_become_one_box():
    boxes = np.array(
        [[[0.3 * i, 0, 0.5 * j], [0.3 * i + 0.3, 0, 0.5 * j + 0.5]] for i in range(9) for j in range(3)]
    )
    merged, _ = merged_boxes(boxes, NOTHING_FREE, 0.01, 100)
    np.testing.assert_allclose(merged, [[[0.0, 0.0, 0.0], [2.7, 0.0, 1.5]]])


def test_walls_at_a_corner_stay_two():
    boxes = np.array([[[0.0, 0, 0], [3, 0.05, 1]], [[0.0, 0, 0], [0.05, 3, 1]]])
    assert len(merged_boxes(boxes, NOTHING_FREE, 0.02, 1)[0]) == 2


def test_overlapping_pieces_that_only_all_together_fill_a_box_merge():
    # Four pieces around a middle: no two of them fill the box around these.
    boxes = np.array(
        [
            [[0.0, 0, 0], [2, 1, 1]],
            [[2.0, 0, 0], [3, 2, 1]],
            [[1.0, 2, 0], [3, 3, 1]],
            [[0.0, 1, 0], [1, 3, 1]],
        ]
    )
    boxes = np.concatenate([boxes, [[[1.0, 1, 0], [2, 2, 1]]]])
    assert len(merged_boxes(boxes, NOTHING_FREE, 0.0, 100)[0]) == 1


def test_a_free_code_between_two_boxes_keeps_them_apart():
    boxes = np.array([[[0.0, 0, 0], [1, 1, 1]], [[1.1, 0, 0], [2, 1, 1]]])
    assert len(merged_boxes(boxes, NOTHING_FREE, 0.06, 100)[0]) == 1
    assert len(merged_boxes(boxes, np.array([[1.05, 0.5, 0.0]]), 0.06, 100)[0]) == 2


@given(st.integers(0, 60), st.integers(0, 10**6), st.sampled_from([0.0, 0.02, 0.1]), st.integers(1, 60))
def test_merged_boxes_cover_what_was_covered_and_no_free_code_more(count, seed, slack, most):
    boxes = random_boxes(count, seed)
    free = np.random.default_rng(seed).uniform(0.0, 3.0, (40, 3))
    merged, labels = merged_boxes(boxes, free, slack, most)
    assert (merged[labels, 0] <= boxes[:, 0]).all()
    assert (merged[labels, 1] >= boxes[:, 1]).all()
    assert set(labels.tolist()) == set(range(len(merged)))
    assert (lies_over(merged, free) == lies_over(boxes, free)).all()


def test_merging_adds_little():
    boxes = random_boxes(400, 1)
    merged, _ = merged_boxes(boxes, NOTHING_FREE, 0.01, 400)
    assert len(merged) < 400
    points = np.random.default_rng(2).uniform(-0.2, 3.7, (40_000, 3))
    new = points[are_covered(points, merged) & ~are_covered(points, boxes)]
    assert len(new) < 0.03 * are_covered(points, merged).sum()


def test_too_many_boxes_merge_with_a_larger_slack():
    grid = np.stack(np.meshgrid(np.arange(20), np.arange(20), indexing="ij"), axis=-1).reshape(-1, 2)
    low = np.column_stack([grid * 0.2, np.zeros(len(grid))])
    boxes = np.stack([low, low + np.array([0.1, 0.1, 1.0])], axis=1)
    assert len(merged_boxes(boxes, NOTHING_FREE, 0.01, 400)[0]) == 400
    assert len(merged_boxes(boxes, NOTHING_FREE, 0.01, 50)[0]) <= 50
    # A gap that a robot may fit through is never closed.
    wide = boxes * [8.0 * MOST_SLACK_M, 8.0 * MOST_SLACK_M, 1.0] * 5.0
    assert len(merged_boxes(wide, NOTHING_FREE, 0.01, 50)[0]) == 400
