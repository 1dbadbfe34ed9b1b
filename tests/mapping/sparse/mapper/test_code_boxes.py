"""What is kept of each code's points."""

import numpy as np

from lidarium.mapping.sparse.mapper.code_boxes import boxes_of, masses_of, means_of, normals_of


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
