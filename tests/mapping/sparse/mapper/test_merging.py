"""How much of a box is in no other box."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lidarium.mapping.sparse.mapper.merging import (
    MAX_PIECES,
    MAX_SLACK_M,
    _merged_boxes,
    _uncovered_volume,
    are_covered,
    boxes_of,
    masses_of,
    means_of,
    merged_codes,
    normals_of,
)
from lidarium.mapping.sparse.settings import MapperSettings
from lidarium.mapping.sparse.sparse_map import OccupiedCodes


def random_boxes(count, seed, extent=3.0):
    rng = np.random.default_rng(seed)
    low = rng.uniform(0.0, extent, (count, 3)) * [1.0, 1.0, 0.3]
    return np.stack([low, low + rng.uniform(0.0, 0.5, (count, 3))], axis=1)


@pytest.mark.parametrize("seed", range(4))
def test_the_uncovered_volume_is_exact(seed):
    boxes = random_boxes(12, seed, extent=0.7).reshape(-1, 6)
    around = np.array([0.1, 0.1, 0.05, 0.9, 0.8, 0.5])
    room = np.empty((MAX_PIECES, 6)), np.empty(MAX_PIECES, np.int64)
    found = _uncovered_volume(around, 0.05, boxes, np.inf, *room)
    points = np.random.default_rng(seed).uniform(around[:3] - 0.05, around[3:] + 0.05, (40_000, 3))
    wide = boxes.reshape(-1, 2, 3) + np.array([[[-0.05], [0.05]]])
    share = 1.0 - are_covered(points, wide).mean()
    assert found == pytest.approx(share * np.prod(around[3:] - around[:3] + 0.1), abs=0.01)


def drawn(count=80, codes=7, seed=0):
    generator = np.random.default_rng(seed)
    labels = np.concatenate([np.arange(codes), generator.integers(0, codes, count - codes)])
    return generator.normal(size=(count, 3)), generator.uniform(0.5, 3.0, count), labels


def test_boxes_masses_and_means_are_those_of_each_codes_points():
    points, weights, labels = drawn()
    boxes, means = boxes_of(points, labels, 7), means_of(points, weights, labels, 7)
    for code in range(7):
        own, mass = points[labels == code], weights[labels == code]
        np.testing.assert_array_equal(boxes[code], [own.min(axis=0), own.max(axis=0)])
        np.testing.assert_allclose(means[code], np.average(own, axis=0, weights=mass))
    np.testing.assert_allclose(masses_of(labels, weights, 7), [weights[labels == k].sum() for k in range(7)])


def test_no_codes_have_no_boxes():
    assert boxes_of(np.empty((0, 3)), np.empty(0, np.int64), 0).shape == (0, 2, 3)


def test_a_surface_has_its_normal_whichever_way_round_and_a_ball_or_a_line_has_none():
    generator = np.random.default_rng(3)
    flat = generator.uniform(-1.0, 1.0, (60, 3)) * [1.0, 0.01, 1.0]
    slanted = flat @ np.linalg.qr(generator.normal(size=(3, 3)))[0]
    ball = generator.normal(size=(300, 3))
    line = np.outer(np.linspace(0.0, 1.0, 20), [1.0, 2.0, 3.0])
    points = np.concatenate([flat, slanted, ball, line])
    labels = np.repeat(np.arange(4), [60, 60, 300, 20])
    normals = normals_of(points, np.ones(len(points)), labels, 4)
    np.testing.assert_allclose(normals[0], (0.0, 1.0, 0.0), atol=0.02)
    own = slanted - slanted.mean(axis=0)
    np.testing.assert_allclose(np.linalg.norm(normals[1]), 1.0)
    assert np.abs(own @ normals[1]).max() < 0.05
    assert normals[1][np.abs(normals[1]).argmax()] > 0.0
    assert normals[2].tolist() == [0.0, 0.0, 0.0]


def test_heavy_points_count_more():
    points = np.array([[0.0, 0, 0], [1.0, 0, 0], [4.0, 0, 0]])
    mean = means_of(points, np.array([1.0, 1.0, 6.0]), np.zeros(3, np.int64), 1)
    np.testing.assert_allclose(mean, [[3.125, 0.0, 0.0]])


def test_points_on_the_border_of_a_box_are_covered():
    boxes = np.array([[[0.0, 0, 0], [1, 1, 1]], [[3.0, 3, 0], [3, 3, 0]]])
    points = np.array([[0.0, 0, 0], [1, 1, 1], [3, 3, 0], [1.0001, 1, 1], [3, 3, 0.1], [-5, 0, 0], [0, 9, 0]])
    assert are_covered(points, boxes).tolist() == [True, True, True, False, False, False, False]
    assert not are_covered(points, np.empty((0, 2, 3))).any()


NOTHING_FREE = np.empty((0, 3))


def lies_over(boxes, nodes):
    return (
        ((nodes[:, None, :2] >= boxes[None, :, 0, :2]) & (nodes[:, None, :2] <= boxes[None, :, 1, :2]))
        .all(axis=2)
        .any(axis=1)
    )


def test_a_box_within_another_goes():
    boxes = np.array([[[0.0, 0, 0], [1, 1, 1]], [[0.2, 0.2, 0.2], [0.4, 0.4, 0.4]]])
    merged, labels = _merged_boxes(boxes, NOTHING_FREE, 0.0, 100)
    assert merged.tolist() == boxes[:1].tolist()
    assert labels.tolist() == [0, 0]


def test_pieces_of_a_wall_become_one_box():
    boxes = np.array([[[0.3 * i, 0, 0.5 * j], [0.3 * i + 0.3, 0, 0.5 * j + 0.5]] for i in range(9) for j in range(3)])
    merged, _ = _merged_boxes(boxes, NOTHING_FREE, 0.01, 100)
    np.testing.assert_allclose(merged, [[[0.0, 0.0, 0.0], [2.7, 0.0, 1.5]]])


def test_walls_at_a_corner_stay_two():
    boxes = np.array([[[0.0, 0, 0], [3, 0.05, 1]], [[0.0, 0, 0], [0.05, 3, 1]]])
    assert len(_merged_boxes(boxes, NOTHING_FREE, 0.02, 1)[0]) == 2


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
    assert len(_merged_boxes(boxes, NOTHING_FREE, 0.0, 100)[0]) == 1


def test_a_free_code_between_two_boxes_keeps_them_apart():
    boxes = np.array([[[0.0, 0, 0], [1, 1, 1]], [[1.1, 0, 0], [2, 1, 1]]])
    assert len(_merged_boxes(boxes, NOTHING_FREE, 0.06, 100)[0]) == 1
    assert len(_merged_boxes(boxes, np.array([[1.05, 0.5, 0.0]]), 0.06, 100)[0]) == 2


@given(st.integers(0, 60), st.integers(0, 10**6), st.sampled_from([0.0, 0.02, 0.1]), st.integers(1, 60))
def test_merged_boxes_cover_what_was_covered_and_no_free_code_more(count, seed, slack, most):
    boxes = random_boxes(count, seed)
    free = np.random.default_rng(seed).uniform(0.0, 3.0, (40, 3))
    merged, labels = _merged_boxes(boxes, free, slack, most)
    assert (merged[labels, 0] <= boxes[:, 0]).all()
    assert (merged[labels, 1] >= boxes[:, 1]).all()
    assert set(labels.tolist()) == set(range(len(merged)))
    assert (lies_over(merged, free) == lies_over(boxes, free)).all()


def test_merging_adds_little():
    boxes = random_boxes(400, 1)
    merged, _ = _merged_boxes(boxes, NOTHING_FREE, 0.01, 400)
    assert len(merged) < 400
    points = np.random.default_rng(2).uniform(-0.2, 3.7, (40_000, 3))
    new = points[are_covered(points, merged) & ~are_covered(points, boxes)]
    assert len(new) < 0.03 * are_covered(points, merged).sum()


def test_too_many_boxes_merge_with_a_larger_slack():
    grid = np.stack(np.meshgrid(np.arange(20), np.arange(20), indexing="ij"), axis=-1).reshape(-1, 2)
    low = np.column_stack([grid * 0.2, np.zeros(len(grid))])
    boxes = np.stack([low, low + np.array([0.1, 0.1, 1.0])], axis=1)
    assert len(_merged_boxes(boxes, NOTHING_FREE, 0.01, 400)[0]) == 400
    assert len(_merged_boxes(boxes, NOTHING_FREE, 0.01, 50)[0]) <= 50
    # A gap that a robot may fit through is never closed.
    wide = boxes * [8.0 * MAX_SLACK_M, 8.0 * MAX_SLACK_M, 1.0] * 5.0
    assert len(_merged_boxes(wide, NOTHING_FREE, 0.01, 50)[0]) == 400


SETTINGS = MapperSettings()


def codes(boxes, weights, normals, frames):
    boxes = np.array(boxes, float)
    return OccupiedCodes(
        boxes=boxes,
        centres=boxes.mean(axis=1),
        weights=np.array(weights, float),
        normals=np.array(normals, float),
        frames=np.array(frames),
    )


# Two halves of one wall, and a box apart.
LEFT, RIGHT, APART = [[0, 0, 0], [1, 0.01, 1]], [[1, 0, 0], [2, 0.01, 1]], [[5, 5, 0], [5.5, 5.5, 1]]
ALONG_Y, NONE = (0.0, 1.0, 0.0), (0.0, 0.0, 0.0)


def test_halves_of_a_wall_become_one_code_of_the_heavier_frame():
    both = codes([LEFT, APART, RIGHT], [1.0, 2.0, 3.0], [ALONG_Y, NONE, (0.0, -1.0, 0.0)], [4, 5, 6])
    merged, origins = merged_codes(both, NOTHING_FREE, SETTINGS)
    assert len(merged) == 2
    wall = int(np.flatnonzero(origins == -1)[0])
    np.testing.assert_allclose(merged.boxes[wall], [[0, 0, 0], [2, 0.01, 1]])
    np.testing.assert_allclose(merged.centres[wall], (1.25, 0.005, 0.5))
    assert (merged.weights[wall], merged.frames[wall]) == (4.0, 6)
    np.testing.assert_allclose(merged.normals[wall], ALONG_Y)
    assert origins[1 - wall] == 1
    np.testing.assert_array_equal(merged.boxes[1 - wall], both.boxes[1])


@pytest.mark.parametrize("second", [(1.0, 0.0, 0.0), NONE])
def test_codes_that_share_no_plane_have_no_normal(second):
    both = codes([LEFT, RIGHT], [1.0, 1.0], [ALONG_Y, second], [0, 0])
    merged, _ = merged_codes(both, NOTHING_FREE, SETTINGS)
    assert merged.normals.tolist() == [[0.0, 0.0, 0.0]]


def test_boxes_do_not_grow_over_free_codes():
    gapped = codes([LEFT, [[1.02, 0, 0], [2, 0.01, 1]]], [1.0, 1.0], [ALONG_Y] * 2, [0, 1])
    free = np.array([[1.01, 0.005, 0.0]])
    assert len(merged_codes(gapped, NOTHING_FREE, MapperSettings(slack_m=0.05))[0]) == 1
    kept, origins = merged_codes(gapped, free, MapperSettings(slack_m=0.05))
    assert len(kept) == 2
    assert sorted(origins.tolist()) == [0, 1]


def test_codes_that_are_not_to_merge_stay_as_they_are():
    both = codes([LEFT, RIGHT], [1.0, 1.0], [ALONG_Y] * 2, [0, 1])
    same, origins = merged_codes(both, NOTHING_FREE, MapperSettings(merges=False))
    assert same is both
    assert origins.tolist() == [0, 1]
