"""Nodes along a robot's path, the measurements between them, and their poses."""

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.rigid import composed, relative, wrapped
from lidarium.mapping.geometry.small_matrices import inverse
from lidarium.mapping.grids.growing_array import GrowingArray
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.localization.graph.closures import Closure
from lidarium.mapping.localization.graph.pose_graph import Edges, optimised, residuals
from lidarium.mapping.localization.matching.wall_compass import WallCompass
from lidarium.mapping.localization.odometry import compounded
from lidarium.mapping.localization.settings import GraphSettings

Edge = tuple[int, int, NDArray[np.float64], NDArray[np.float64], bool]
"""Nodes a and b, b as seen from a, its information, and whether that may be wrong."""


class NodeGraph:
    """The way so far, to which nodes and closures come.

    Parameters
    ----------
    settings : GraphSettings
        How.
    compass : WallCompass, optional
        Turns new nodes, and has its say with the closures.
    pose : (3,) float64
        The first node: x, y, theta [m, rad].

    Attributes
    ----------
    nodes : (nodes, 3) float64
        Their believed poses now [m, rad].
    covariance : (3, 3) float64
        That of the last node against the first [m^2, m rad, rad^2].
    """

    def __init__(self, settings: GraphSettings, compass: WallCompass | None, pose: NDArray[np.float64]) -> None:
        self._settings, self._compass = settings, compass
        self.nodes = np.array(pose, np.float64)[None]
        self.covariance = np.zeros((3, 3))
        # The motion from each node to the next: what was measured, and how well.
        self._motions, self._covariances = GrowingArray((3,), np.float64), GrowingArray((3, 3), np.float64)
        self._closures: list[Edge] = []
        self._waiting = 0

    def add(self, since: NDArray[np.float64], covariance: NDArray[np.float64]) -> None:
        """Add a node at a motion (3,) from the last one, with its covariance (3, 3).

        The motion is in the last node's frame [m, rad].
        """
        last, number = self.nodes[-1], len(self.nodes)
        self._motions.append(since)
        self._covariances.append(covariance)
        self.covariance = compounded(last, self.covariance, since, covariance)
        pose = composed(last, since)
        if self._compass is not None:
            turn, variance = self._compass.turn(number, float(since[2]), float(covariance[2, 2]), float(pose[2]))
            pose[2] = wrapped(pose[2] + turn)
            share = np.array([1.0, 1.0, np.sqrt(min(variance / self.covariance[2, 2], 1.0))])
            self.covariance *= share[:, None] * share
        self.nodes = np.vstack([self.nodes, pose])

    def begin_at(self, since: NDArray[np.float64]) -> None:
        """Move all nodes after the first, so that the second has a given pose.

        The pose is x, y, theta (3,) in the first node's frame [m, rad].
        """
        self._motions.rows[0] = since
        before, begin = self.nodes[1], composed(self.nodes[0], since)
        self.nodes = np.vstack([self.nodes[:1], composed(begin, relative(before, self.nodes[1:]))])

    def covariance_since(self, node: int) -> NDArray[np.float64]:
        """Return the covariance (3, 3) of the last node relative to another.

        In that node's frame, by the motions between [m^2, m rad, rad^2].
        """
        poses = relative(self.nodes[node], self.nodes[node:])
        cosine, sine = np.cos(poses[:-1, 2]), np.sin(poses[:-1, 2])
        rest = poses[-1, :2] - poses[1:, :2]
        levers = np.zeros((len(rest), 3, 3))
        levers[:, 0, 0], levers[:, 0, 1], levers[:, 0, 2] = cosine, -sine, -rest[:, 1]
        levers[:, 1, 0], levers[:, 1, 1], levers[:, 1, 2] = sine, cosine, rest[:, 0]
        levers[:, 2, 2] = 1.0
        return np.asarray(_carried(levers, self._covariances.rows[node:]))

    def close(self, closures: list[Closure]) -> bool:
        """Take in closures, at least one.

        Return whether poses are to be settled: they contradict some, or enough of them wait.
        """
        self._closures += [
            (closure.old, closure.new, closure.measured, inverse(closure.covariance), True) for closure in closures
        ]
        self._waiting += len(closures)
        rest = np.abs(residuals(self.nodes, _arrays(self._closures[-len(closures) :])))
        settings = self._settings
        is_far = np.hypot(rest[:, 0], rest[:, 1]) > settings.correct_beyond_m
        return (
            bool(is_far.any() or (rest[:, 2] > settings.correct_beyond_angle).any())
            or self._waiting >= settings.waiting
        )

    @property
    def has_waiting(self) -> bool:
        """Whether closures came of which the poses do not know yet."""
        return self._waiting > 0

    def settle(self, newest: int) -> None:
        """Bring all poses to agree; the last closures (a given number) are new."""
        walls = self._compass.edges(self.nodes) if self._compass is not None else []
        numbers = np.arange(len(self._motions))
        motions = Edges(
            numbers,
            numbers + 1,
            self._motions.rows,
            np.reshape([inverse(covariance) for covariance in self._covariances.rows], (-1, 3, 3)),
            np.zeros(len(numbers), np.bool_),
        )
        edges = _joined([_arrays(walls), motions, _arrays(self._closures)])
        self.nodes, self.covariance = optimised(
            self.nodes, edges, self._settings.robust_scale, self._settings.iterations, newest
        )
        if self._compass is not None:
            self._compass.relieve(float(self.covariance[2, 2]))
        self._waiting = 0


def _arrays(edges: list[Edge]) -> Edges:
    a, b, measured, information, is_robust = zip(*edges, strict=True) if edges else ((),) * 5
    number = len(edges)
    ends = np.array(a, np.int64), np.array(b, np.int64)
    return Edges(
        *ends,
        np.reshape(measured, (number, 3)),
        np.reshape(information, (number, 3, 3)),
        np.array(is_robust, np.bool_),
    )


def _joined(parts: list[Edges]) -> Edges:
    a, b, measured, information, is_robust = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    return Edges(a, b, measured, information, is_robust)


@kernel
def _carried(levers: Array, covariances: Array) -> Array:
    """Return the sum of ``L C L^T`` over levers and covariances (n, 3, 3)."""
    found = np.zeros((3, 3))
    for n in range(len(levers)):
        for i in range(3):
            for j in range(3):
                for k in range(3):
                    for m in range(3):
                        found[i, j] += levers[n, i, k] * covariances[n, k, m] * levers[n, j, m]
    return found
