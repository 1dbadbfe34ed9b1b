import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from lidarium.mapping.localization.graph.elimination import elimination, factorise, solve


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
    places = elimination(count, pairs[:, 0], pairs[:, 1])
    factor = blocks_of(matrix, places)
    assert factorise(places, factor)
    right = np.random.default_rng(seed).normal(size=(count, 3))
    assert np.allclose(
        solve(places, factor, right), np.linalg.solve(matrix, right.ravel()).reshape(-1, 3), atol=1e-9
    )


@given(graphs())
def test_blocks_are_where_poses_are_joined_and_where_elimination_joins_them(graph):
    count, pairs, _ = graph
    places = elimination(count, pairs[:, 0], pairs[:, 1])
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
    places = elimination(50, np.arange(49), np.arange(1, 50))
    assert len(places.rows) == 50 + 49


def test_a_matrix_that_is_not_positive_definite_has_no_factor():
    pairs = np.array([[0, 1]])
    places = elimination(2, pairs[:, 0], pairs[:, 1])
    assert not factorise(places, blocks_of(np.eye(6) - 2.0 * np.eye(6)[:, ::-1], places))
    assert not factorise(places, blocks_of(np.full((6, 6), np.nan), places))
