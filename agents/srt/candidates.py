"""Next places from a node: through its openings, or anywhere.

Places anywhere are for the base algorithm.
"""

import math
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidarium.agents.intent import Intent
from lidarium.agents.srt.memories import Memory
from lidarium.agents.srt.safe_region import DIRECTIONS, UNIT, Opening, least_opening
from lidarium.agents.srt.senses import Senses
from lidarium.agents.srt.settings import SrtSettings
from lidarium.agents.srt.tree import Node

TRIED_NEAR = 0.3
"""Distance within which a place counts as tried for a near opening [m].

A place this near to one from which an opening near by was observed is not visited for it again.
"""


NEARLY = 0.95
"""Share of the wanted offset beside an edge that suffices.

A robot that reaches it need not try to pass the edge wider.
"""


GOT_ON = 0.8
"""Distance driven along free rays before checking their target [m].

The robot then checks whether the rays were seen through.
"""

STANDS = (1, 3, 5)
"""Distances at which a robot may stand before an opening [0.1 m].

They are for openings that no straight path leads to, and count from the opening.
"""


ATTEMPTS, PATCH, ATTEMPT_REACH = 3, 0.3, 1.5
"""Attempts to see a patch, its side [m], and the reach of an attempt [m].

A patch beyond openings counts as unseeable after this number of attempts. An attempt counts this far from what the
robot came for.
"""


@dataclass(frozen=True, slots=True)
class Candidate:
    """A place to go to from a node.

    Attributes
    ----------
    node : int
        The node from which a straight way leads there.
    place : (2,) float64
        Where [m].
    opening : Opening or None
        Its opening; None in the base algorithm, for the goal and for a frontier of the map.
    focus : (2,) float64
        Point to observe [m].
    is_frontier : bool
        Whether it is for a frontier of the map.
    """

    node: int
    place: NDArray[np.float64]
    opening: Opening | None
    focus: NDArray[np.float64]
    is_frontier: bool = False


class CandidateSource:
    """Draws candidates, as the settings want them.

    Parameters
    ----------
    settings : SrtSettings
        Which.
    body : float
        Radius of the robot with its margin [m].
    generator : numpy.random.Generator
        Source of all random draws.

    Attributes
    ----------
    intent : Intent
        Last goal of the robot.
    """

    def __init__(self, settings: SrtSettings, body: float, generator: np.random.Generator) -> None:
        self.intent = Intent()
        self._settings, self._least, self._generator = settings, least_opening(body), generator
        self._tried: list[tuple[NDArray[np.float64], NDArray[np.float64]]] = []
        self._attempts = Counter[tuple[int, int]]()

    def note_tried(self, candidate: Candidate) -> None:
        """Remember that a robot was at a candidate.

        Its goal is not approached from that position again.
        """
        self._tried.append((candidate.place, candidate.focus))
        if candidate.opening is not None:
            candidate.opening.is_tried = True
            beyond = candidate.opening.beyond
            near = beyond[np.hypot(*(beyond - candidate.focus).T) <= ATTEMPT_REACH]
            self._attempts.update(set(_patches(near)))

    def of_node(self, node: Node, memory: Memory, others: Iterable[Node]) -> list[Candidate]:
        """Return the valid candidates of a node.

        There is one for each opening, or the first valid one that is drawn.
        """
        if self._settings.algorithm == "base":
            return self._anywhere(node, list(others))
        found = [(opening, self._open(node, opening, memory)) for opening in node.openings]
        found = [(opening, points) for opening, points in found if len(points)]
        if not found:
            return []
        if self._settings.candidates == "random":
            return self._drawn(node, found, list(others))
        rivals = list(others) if self._settings.memory == "regions" else []
        candidates = [self._through(node, opening, points, rivals) for opening, points in found]
        return [candidate for candidate in candidates if candidate is not None]

    def beside(self, node: Node, memory: Memory) -> list[Candidate]:
        """Return positions before each opening of a node.

        They are on the side from which the opening was seen, whether or not a straight path leads
        there.
        """
        candidates = []
        for opening in node.openings:
            points = self._open(node, opening, memory)
            if len(points):
                middle = int(points[len(points) // 2])
                inwards = opening.points[middle] - opening.beyond[middle]
                positions = [opening.points[middle] + steps * inwards for steps in STANDS]
                candidates += [
                    Candidate(node.number, position, opening, opening.points[middle]) for position in positions
                ]
        return [candidate for candidate in candidates if not self._was_tried(candidate)]

    def is_open(self, candidate: Candidate, node: Node, memory: Memory) -> bool:
        """Whether a candidate's opening is still open."""
        if candidate.is_frontier:
            return memory.is_frontier(candidate.focus)
        return candidate.opening is None or bool(len(self._open(node, candidate.opening, memory)))

    def may_drop(self, candidate: Candidate, departed: float, senses: Senses) -> bool:
        """Whether a robot that is so far from its last node [m] may drop a candidate that is seen through.

        Every step sees a little more beyond free rays: a target there is kept until the robot has got on; so
        does one towards a goal.
        """
        is_along_rays = candidate.opening is not None and not candidate.opening.is_gap
        waits = is_along_rays or senses.goal is not None
        return departed >= (GOT_ON if waits else self._settings.least_step)

    def _open(self, node: Node, opening: Opening, memory: Memory) -> NDArray[np.int64]:
        return opening.open_points(lambda points: self._is_done(points, node, memory), self._least)

    def _is_done(self, points: NDArray[np.float64], node: Node, memory: Memory) -> NDArray[np.bool_]:
        """Whether points were seen, or stayed unseen after repeated attempts.

        Attempts are those of robots that came to observe the points.
        """
        is_done = memory.is_seen(points, node)
        unseen = np.flatnonzero(~is_done)
        if self._attempts and len(unseen):
            is_done[unseen] = [self._attempts[patch] >= ATTEMPTS for patch in _patches(points[unseen])]
        return is_done

    def _through(self, node: Node, opening: Opening, points: NDArray[np.int64], others: list[Node]) -> Candidate | None:
        """Return the first valid candidate of an opening.

        Candidates are tried from its middle or its longest ray outwards.
        """
        settings = self._settings
        share = 1.0 if settings.candidates == "farthest" else settings.step_share
        best: Candidate | None = None
        for index in self._order(node, opening, points):
            candidate = self._at(node, opening, index, share)
            if self.is_valid(candidate, node, others):
                if not opening.is_gap or math.dist(candidate.place, node.place) >= NEARLY * opening.reaches[index]:
                    return candidate
                if best is None or math.dist(candidate.place, node.place) > math.dist(best.place, node.place):
                    best = candidate
        return best

    def _order(self, node: Node, opening: Opening, points: NDArray[np.int64]) -> list[int]:
        """Return the directions of an opening in the order in which they are tried."""
        if opening.is_gap:
            return list(range(len(opening.directions)))
        if self._settings.candidates == "farthest":
            order = np.argsort(-node.safe.radii[opening.directions[points]], kind="stable")
        else:
            order = np.argsort(np.abs(points - np.median(points)), kind="stable")
        chosen = np.unique(np.linspace(0, len(order) - 1, min(self._settings.tries, len(order))).astype(np.int64))
        return [int(points[index]) for index in order[chosen]]

    def _drawn(self, node: Node, found: list[tuple[Opening, NDArray[np.int64]]], others: list[Node]) -> list[Candidate]:
        """Draw an opening by its width and a point of it, until one is valid."""
        widths = np.array([opening.width for opening, _ in found]) + 1e-9
        rivals = others if self._settings.memory == "regions" else []
        for _ in range(self._settings.tries):
            opening, points = found[int(self._generator.choice(len(found), p=widths / widths.sum()))]
            ways = len(opening.directions) if opening.is_gap else points
            candidate = self._at(node, opening, int(self._generator.choice(ways)), self._settings.step_share)
            if self.is_valid(candidate, node, rivals):
                return [candidate]
        return []

    def _at(self, node: Node, opening: Opening, index: int, share: float) -> Candidate:
        direction = int(opening.directions[index])
        distance = min(share * float(node.safe.radii[direction]), float(opening.reaches[index]))
        focus = opening.points[len(opening.points) // 2 if opening.is_gap else index]
        return Candidate(node.number, node.place + distance * UNIT[direction], opening, focus)

    def _anywhere(self, node: Node, others: list[Node]) -> list[Candidate]:
        """Draw directions of the full circle until a candidate is valid.

        The base algorithm does so.
        """
        for _ in range(self._settings.tries):
            direction = int(self._generator.integers(DIRECTIONS))
            position = node.place + self._settings.step_share * node.safe.radii[direction] * UNIT[direction]
            candidate = Candidate(node.number, position, None, position)
            if self.is_valid(candidate, node, others):
                return [candidate]
        return []

    def is_valid(self, candidate: Candidate, node: Node, others: Iterable[Node]) -> bool:
        """Whether a candidate is valid.

        It is far enough from all nodes, within its own node's safe region, outside of the others',
        and was not tried.
        """
        if not node.safe.contains(candidate.place):
            return False
        for other in (node, *others):
            # Where a region is empty, as beside a wall, the distance alone keeps a robot from coming again
            # and again.
            if math.dist(candidate.place, other.place) <= self._settings.least_step:
                return False
            if bool(other.safe.contains(candidate.place)) and not np.array_equal(other.place, node.place):
                return False
        return not self._was_tried(candidate)

    def _was_tried(self, candidate: Candidate) -> bool:
        return any(
            math.dist(position, candidate.place) < TRIED_NEAR and math.dist(focus, candidate.focus) < 2.0 * TRIED_NEAR
            for position, focus in self._tried
        )


def _patches(points: NDArray[np.float64]) -> list[tuple[int, int]]:
    """Return the patch of each point (n, 2)."""
    return [(int(x), int(y)) for x, y in np.floor(points / PATCH)]
