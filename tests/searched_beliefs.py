"""Beliefs to search for paths, and costs by an explicit graph."""

import math

import numpy as np
from hypothesis import assume
from hypothesis import strategies as st
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra

from lidarium.mapping.planning.clearance import ClearanceField, clearance
from lidarium.mapping.planning.footprint import Footprint
from lidarium.mapping.planning.search.path_search import SearchSpace

RESOLUTION = 0.025


SEEDS = st.integers(0, 10**6)


def random_belief(seed, shape=(36, 40), walls=6, unknown=2):
    """Free floor with short walls, patches of unknown and an occupied rim in places."""
    random = np.random.default_rng(seed)
    belief = np.full(shape, -5, np.int8)
    for value, count in ((9, walls), (0, unknown)):
        for _ in range(count):
            row, column = random.integers(0, shape[0]), random.integers(0, shape[1])
            length = random.integers(1, 14)
            if random.random() < 0.5:
                belief[row : row + length, column : column + 1 + (value == 0) * length] = value
            else:
                belief[row, column : column + length] = value
    return belief


def made(belief, maximum=0.6, resolution=RESOLUTION):
    field = ClearanceField(belief.shape, resolution, maximum)
    field.update(belief)
    return SearchSpace(belief.shape, resolution), field


def oracle(belief, footprint, start, closed=None):
    """Costs [m] by scipy over all steps that keep the clearance, with costs in floating point."""
    room = clearance(belief > 0, RESOLUTION, 0.6).astype(float)
    squared = np.rint((room / RESOLUTION * 2) ** 2).astype(int)
    least = math.ceil((2 * footprint.radius / RESOLUTION) ** 2 - 1e-6)
    open_cells = (belief < 0) & (squared >= max(least, 1))
    if closed is not None:
        open_cells &= ~closed
    width = footprint.preferred - footprint.radius
    factor = 1.0 + footprint.penalty * np.clip((footprint.preferred - room) / width, 0, 1) ** 2
    fits = (belief < 0) & (squared >= max(least, 1))
    rows, columns = belief.shape
    tails, heads, costs = [], [], []
    for row, column in np.argwhere(open_cells):
        for up in (-1, 0, 1):
            for right in (-1, 0, 1):
                to_row, to_column = row + up, column + right
                if (
                    (up == 0 and right == 0)
                    or not (0 <= to_row < rows and 0 <= to_column < columns)
                    or not open_cells[to_row, to_column]
                ):
                    continue
                if up and right:
                    if min(squared[row, column], squared[to_row, to_column]) - 2 >= least:
                        fine = belief[to_row, column] < 0 or belief[row, to_column] < 0
                    else:
                        fine = fits[to_row, column] and fits[row, to_column]
                    if not fine:
                        continue
                tails.append(row * columns + column)
                heads.append(to_row * columns + to_column)
                costs.append(
                    math.hypot(up, right) * RESOLUTION * 0.5 * (factor[row, column] + factor[to_row, to_column])
                )
    graph = coo_matrix((costs, (tails, heads)), shape=(belief.size, belief.size)).tocsr()
    return dijkstra(graph, indices=start[0] * columns + start[1]).reshape(belief.shape), open_cells


def open_start(belief, footprint, seed):
    room = clearance(belief > 0, RESOLUTION, 0.6)
    cells = np.argwhere((belief < 0) & (room >= footprint.radius + 1e-6))
    return None if len(cells) == 0 else tuple(int(i) for i in np.random.default_rng(seed).choice(cells))


def beginning(seed):
    """A body, a belief with many walls, where the body stands in it, and what searches want."""
    footprint, belief = Footprint(0.03, 0.1, 3.0), random_belief(seed, shape=(50, 60), walls=10)
    start = open_start(belief, footprint, seed)
    assume(start is not None)
    return footprint, belief, start, *made(belief)
