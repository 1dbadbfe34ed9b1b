"""Obstacles that come and go: the graph is repaired near them, and restored to the bit.

References
----------
Sparse mapper, section 12: the thesis leaves moving obstacles to future work.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.sparse.graph import NodeGrid, TopologicalGraph
from lidarium.mapping.sparse.swept_body import HIGH, LOW, RADIUS, index_boxes, squared_gap


class ChangingGraph:
    """A graph whose obstacles change.

    Edges that an obstacle blocks cost infinity as long as it is there. Only edges near an obstacle are
    tested when it comes or goes.

    Parameters
    ----------
    graph : TopologicalGraph
        The graph of the static map; it is left as it is.

    Attributes
    ----------
    graph : TopologicalGraph
        The graph as it is now.
    """

    def __init__(self, graph: TopologicalGraph) -> None:
        self._base = graph
        self._blocks = np.zeros(len(graph.ends), np.int64)
        self._obstacles: dict[int, NDArray[np.float64]] = {}
        self._next = 0
        firsts = np.repeat(graph.nodes, np.diff(graph.starts), axis=0)
        lengths = np.linalg.norm(graph.nodes[graph.ends] - firsts, axis=1)
        self._longest = float(lengths.max()) if len(lengths) else 0.0
        self.graph = replace(graph, weights=graph.weights.copy())

    @property
    def obstacles(self) -> dict[int, NDArray[np.float64]]:
        """Boxes (2, 3) of the obstacles that are there, by number [m]."""
        return dict(self._obstacles)

    def insert(self, box: NDArray[np.float64]) -> int:
        """Put an obstacle there.

        Parameters
        ----------
        box : (2, 3) float64
            Its low and its high corner [m].
        """
        return self.insert_all([box])[0]

    def insert_all(self, boxes: Sequence[NDArray[np.float64]] | NDArray[np.float64]) -> list[int]:
        """Put obstacles there: all, or none if one of them is not a box.

        Parameters
        ----------
        boxes : (M, 2, 3) float64
            Their low and high corners [m].
        """
        corners = [_checked(box) for box in boxes]
        numbers = list(range(self._next, self._next + len(corners)))
        self._next += len(corners)
        self._obstacles.update(zip(numbers, corners, strict=True))
        self._repair(corners, 1)
        return numbers

    def remove(self, number: int) -> None:
        """Take an obstacle away."""
        self.remove_all([number])

    def remove_all(self, numbers: Sequence[int]) -> None:
        """Take obstacles away: all, or none if a number is unknown."""
        for number in numbers:
            if number not in self._obstacles:
                raise ValueError(f"there is no obstacle {number}; there are {sorted(self._obstacles)}")
        self._repair([self._obstacles.pop(number) for number in dict.fromkeys(numbers)], -1)

    def _repair(self, boxes: Sequence[NDArray[np.float64]], change: int) -> None:
        """Count obstacles in or out at the edges that they block."""
        base, weights = self._base, self.graph.weights
        for box in boxes:
            edges = _edges_blocked(base.grid, base.starts, base.ends, box.ravel(), base.body.numbers, self._longest)
            self._blocks[edges] += change
            weights[edges] = np.where(self._blocks[edges] > 0, np.inf, base.weights[edges])
        moving = np.array(list(self._obstacles.values())).reshape(-1, 6)
        index = index_boxes(np.concatenate([base.index.boxes, moving])) if len(moving) else base.index
        self.graph = replace(self.graph, index=index)


def _checked(box: NDArray[np.float64]) -> NDArray[np.float64]:
    corners = np.asarray(box, np.float64)
    if corners.shape != (2, 3) or not np.isfinite(corners).all() or not (corners[0] <= corners[1]).all():
        raise ValueError(f"box is {box}; want its low corner x, y, z and its high corner [m]")
    return corners


@kernel
def _edges_blocked(grid: NodeGrid, starts: Array, ends: Array, box: Array, body: Array, longest: float) -> Any:  # noqa: ANN401
    """Return the edges along which a body meets a box, at both of their ends, (E,)."""
    reach, squared = body[RADIUS] + longest, body[RADIUS] * body[RADIUS]
    cell, rows, columns = grid.cell[0], grid.shape[0], grid.shape[1]
    low_column = int(max((box[0] - reach - grid.origin[0]) // cell, 0.0))
    high_column = int(min((box[3] + reach - grid.origin[0]) // cell, columns - 1.0))
    low_row = int(max((box[1] - reach - grid.origin[1]) // cell, 0.0))
    high_row = int(min((box[4] + reach - grid.origin[1]) // cell, rows - 1.0))
    blocked, found = np.empty(ends.shape[0], np.int64), 0
    for row in range(low_row, high_row + 1):
        for column in range(low_column, high_column + 1):
            place = row * columns + column
            for member in range(grid.starts[place], grid.starts[place + 1]):
                a = grid.nodes[grid.members[member]]
                for edge in range(starts[grid.members[member]], starts[grid.members[member] + 1]):
                    b = grid.nodes[ends[edge]]
                    low, high = min(a[2], b[2]) + body[LOW], max(a[2], b[2]) + body[HIGH]
                    if box[2] >= high or box[5] <= low:
                        continue
                    if squared_gap(a[0], a[1], b[0], b[1], box) < squared:
                        blocked[found] = edge
                        found += 1
    return blocked[:found]
