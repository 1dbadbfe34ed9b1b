import itertools
import math

import numpy as np
import pytest
import scipy.optimize
from hypothesis import given
from hypothesis import strategies as st

from lidarium.mapping.geometry.rigid import composed, relative
from lidarium.mapping.localization.graph.pose_graph import Edges, _elimination, _factorise, _solve, optimised, residuals

SIDE = 10


def square():
    """True poses along a square, back to the start."""
    poses = [np.zeros(3)]
    for k in range(4 * SIDE):
        turn = math.pi / 2 if k % SIDE == SIDE - 1 else 0.0
        poses.append(composed(poses[-1], np.array([1.0, 0.0, turn])))
    return np.array(poses)


def edges_of(pairs, measured, robust):
    information = np.array([np.diag([1e4, 1e4, 1e5]) for _ in pairs])
    a, b = np.array(pairs).T
    return Edges(a, b, np.array(measured), information, np.array(robust))


def drifted(truth, wrong=(0.0, 0.0, 0.01)):
    """Motions that all turn a little too far, and the poses that they lead to."""
    motions = [relative(a, b) + np.array(wrong) for a, b in itertools.pairwise(truth)]
    poses = [np.zeros(3)]
    for motion in motions:
        poses.append(composed(poses[-1], motion))
    return motions, np.array(poses)


def test_a_closure_takes_out_most_of_the_drift():
    truth = square()
    motions, poses = drifted(truth)
    pairs = [(k, k + 1) for k in range(len(motions))]
    edges = edges_of(
        [*pairs, (0, len(motions))],
        [*motions, relative(truth[0], truth[-1])],
        [False] * len(motions) + [True],
    )
    corrected, covariance = optimised(poses, edges, 5.0, 20, 1)
    assert np.abs(poses - truth)[:, :2].max() > 1.0
    assert np.abs(corrected - truth)[:, :2].max() < 0.15
    assert corrected[0].tolist() == [0.0, 0.0, 0.0]
    assert (np.linalg.eigvalsh(covariance) > 0.0).all()


def test_a_false_closure_does_not_bend_what_others_hold():
    truth = square()
    motions = [relative(a, b) for a, b in itertools.pairwise(truth)]
    pairs = [(k, k + 1) for k in range(len(motions))]
    good = [(0, 40), (1, 39), (2, 38)]
    measured = [*motions, *(relative(truth[a], truth[b]) for a, b in good), np.array([3.0, 0.0, 0.0])]
    edges = edges_of([*pairs, *good, (5, 25)], measured, [False] * len(motions) + [True] * 4)
    corrected, _ = optimised(truth, edges, 2.0, 20, 4)
    assert np.abs(corrected - truth)[:, :2].max() < 0.05


def test_poses_that_agree_stay():
    truth = square()
    motions = [relative(a, b) for a, b in itertools.pairwise(truth)]
    corrected, covariance = optimised(
        truth, edges_of([(k, k + 1) for k in range(len(motions))], motions, [False] * len(motions)), 2.0, 5, 0
    )
    assert np.allclose(relative(truth, corrected), 0.0, atol=1e-9)
    # Along a chain variances add up, and headings lever the rest.
    assert covariance[2, 2] == pytest.approx(len(motions) / 1e5, rel=1e-3)


def test_one_pose_is_known():
    poses, covariance = optimised(np.ones((1, 3)), edges_of([(0, 0)], [np.zeros(3)], [False]), 1.0, 3, 0)
    assert poses.tolist() == [[1.0, 1.0, 1.0]]
    assert not covariance.any()


def test_residuals_turn_the_short_way():
    poses = np.array([[0.0, 0.0, 3.0], [0.0, 0.0, -3.0]])
    rest = residuals(poses, edges_of([(0, 1)], [np.array([0.0, 0.0, 2 * math.pi - 6.0 - 0.1])], [False]))
    assert rest[0, 2] == pytest.approx(0.1)


def test_the_optimum_is_that_of_dense_least_squares():
    truth, generator = square(), np.random.default_rng(3)
    pairs = [(k, k + 1) for k in range(len(truth) - 1)] + [(0, 40), (3, 38), (38, 3), (10, 31), (15, 26)]
    measured = [relative(truth[a], truth[b]) + generator.normal(scale=[0.02, 0.02, 0.01]) for a, b in pairs]
    edges = edges_of(pairs, measured, [False] * len(pairs))
    corners = generator.normal(size=(len(pairs), 3, 3))
    edges = edges._replace(information=edges.information + 1e3 * corners @ corners.swapaxes(1, 2))
    roots = np.linalg.cholesky(edges.information).swapaxes(1, 2)

    def weighted(free):
        poses = np.vstack([truth[:1], free.reshape(-1, 3)])
        return (roots @ residuals(poses, edges)[:, :, None]).ravel()

    oracle = scipy.optimize.least_squares(weighted, truth[1:].ravel(), xtol=1e-12, ftol=1e-12, gtol=1e-12)
    poses = truth
    for _ in range(5):
        poses, covariance = optimised(poses, edges, 2.0, 20, 0)
    assert np.abs(relative(poses[1:], oracle.x.reshape(-1, 3))).max() < 1e-6
    assert np.allclose(covariance, np.linalg.inv(oracle.jac.T @ oracle.jac)[-3:, -3:], rtol=1e-4)


@st.composite
def graphs(draw):
    """How many poses, and which are joined: a chain of most of them, and pairs at random."""
    count = draw(st.integers(1, 25))
    number = st.integers(0, count - 1)
    pairs = (
        draw(st.lists(st.tuples(number, number).filter(lambda pair: pair[0] != pair[1]), max_size=30))
        if count > 1
        else []
    )
    chain = [(k, k + 1) for k in range(count - 1) if k % 7 != 6]
    return count, np.array([*chain, *pairs], np.int64).reshape(-1, 2), draw(st.integers(0, 2**32 - 1))


def matrix_of(count, pairs, seed):
    """A positive definite matrix with blocks where poses are joined."""
    generator = np.random.default_rng(seed)
    matrix = 0.5 * np.eye(3 * count)
    for pair in pairs:
        places = (3 * pair[:, None] + np.arange(3)).ravel()
        jacobian = generator.normal(size=(3, 6))
        matrix[np.ix_(places, places)] += jacobian.T @ jacobian
    return matrix


def blocks_of(matrix, places):
    """The lower triangle of the matrix, block by block, in the order of elimination."""
    pose = np.argsort(places.turn)
    columns = np.repeat(np.arange(len(pose)), np.diff(places.starts))
    corners = 3 * np.stack([pose[places.rows], pose[columns]], axis=1)
    return np.array([matrix[row : row + 3, column : column + 3] for row, column in corners])


@given(graphs())
def test_the_factor_solves_what_the_dense_matrix_solves(graph):
    count, pairs, seed = graph
    matrix = matrix_of(count, pairs, seed)
    places = _elimination(count, pairs[:, 0], pairs[:, 1])
    factor = blocks_of(matrix, places)
    assert _factorise(places, factor)
    right = np.random.default_rng(seed).normal(size=(count, 3))
    assert np.allclose(_solve(places, factor, right), np.linalg.solve(matrix, right.ravel()).reshape(-1, 3), atol=1e-9)


@given(graphs())
def test_blocks_are_where_poses_are_joined_and_where_elimination_joins_them(graph):
    count, pairs, _ = graph
    places = _elimination(count, pairs[:, 0], pairs[:, 1])
    assert sorted(places.turn) == list(range(count))
    joined = np.eye(count, dtype=bool)
    joined[places.turn[pairs].T[0], places.turn[pairs].T[1]] = True
    joined |= joined.T
    for k in range(count):
        after = np.flatnonzero(joined[k, k:]) + k
        joined[np.ix_(after, after)] = True
    columns = np.repeat(np.arange(count), np.diff(places.starts))
    wanted = np.argwhere(np.tril(joined).T)[:, ::-1]
    assert np.array_equal(np.stack([places.rows, columns], axis=1), wanted)
    assert (places.rows[places.starts[:-1]] == np.arange(count)).all()
    by_row = np.stack([places.rows[places.row_blocks], places.row_columns], axis=1)
    assert np.array_equal(by_row, np.argwhere(np.tril(joined)))


def test_a_chain_fills_nothing():
    places = _elimination(50, np.arange(49), np.arange(1, 50))
    assert len(places.rows) == 50 + 49


def test_a_matrix_that_is_not_positive_definite_has_no_factor():
    pairs = np.array([[0, 1]])
    places = _elimination(2, pairs[:, 0], pairs[:, 1])
    assert not _factorise(places, blocks_of(np.eye(6) - 2.0 * np.eye(6)[:, ::-1], places))
    assert not _factorise(places, blocks_of(np.full((6, 6), np.nan), places))


def test_the_covariance_is_that_of_the_result_also_where_nothing_is_left_to_gain():
    """Where closures agree exactly, steps are rejected and ever more damped; the covariance must not be so."""
    truth = square()[: 2 * SIDE]
    pairs = [*((k, k + 1) for k in range(len(truth) - 1)), (0, len(truth) - 1), (3, len(truth) - 2)]
    measured = [relative(truth[a], truth[b]) for a, b in pairs]
    edges = edges_of(pairs, measured, [False] * len(pairs))
    poses, covariance = optimised(truth, edges, 5.0, 20, 1)
    for _ in range(3):
        poses, again = optimised(poses, edges, 5.0, 20, 1)
        np.testing.assert_allclose(again, covariance, rtol=1e-3)
