"""Floors with a wall and a table, as a robot with a depth camera knows them, for tests of routes."""

import numpy as np

from lidarium.mapping.sparse.exploring.ground import ground_map
from lidarium.mapping.sparse.exploring.navigation import sparse_navigation
from lidarium.mapping.sparse.swept_body import SweptBody

BODY = SweptBody(radius=0.2, height=0.6)
MARGIN_M = 0.05
WALL = np.array([[[2.9, -0.1, 0.0], [3.1, 3.0, 2.0]]])
TABLE = np.array([[[1.0, 1.0, 0.4], [2.0, 2.0, 0.45]]])


def floor_codes(low, high, spacing=0.2):
    x, y = np.meshgrid(np.arange(low[0], high[0], spacing), np.arange(low[1], high[1], spacing))
    return np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])


def seen_cells(*rectangles, shape=(50, 70)):
    cells = np.zeros(shape, np.bool_)
    for x0, y0, x1, y1 in rectangles:
        cells[round(10 * y0) : round(10 * y1), round(10 * x0) : round(10 * x1)] = True
    return cells


def known(boxes, free, trail, cells=None, body=BODY):
    cells = np.ones((50, 70), np.bool_) if cells is None else cells
    ground = ground_map(cells, (0.0, 0.0), 0.1, boxes, body)
    return sparse_navigation(free, boxes, ground, np.array(trail, float).reshape(-1, 3), body, MARGIN_M)
