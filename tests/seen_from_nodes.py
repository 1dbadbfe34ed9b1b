"""Views of a square room, and nodes and regions of them, for tests of the sensor-based random tree."""

import numpy as np

from lidarium.agents.srt.safe_region import ANGLES, UNIT, openings_of, safe_region, seen_region
from lidarium.agents.srt.tree import Node

BODY, PERCEPTION = 0.2, 4.0
HERE = np.zeros(2)


def box_view(half=2.0, door=None):
    """What is seen from the middle of a square room; through a door, between two angles, nothing is met."""
    view = np.minimum(half / np.maximum(np.abs(UNIT[:, 0]), 1e-9), half / np.maximum(np.abs(UNIT[:, 1]), 1e-9))
    if door is not None:
        view[(door[0] <= ANGLES) & (door[1] >= ANGLES)] = np.inf
    return view


def region(view, shape="radial", place=HERE, heading=0.0):
    return safe_region(place, view, heading, shape, BODY, PERCEPTION)


def node(number, place, view, parent=None):
    place = np.array(place, float)
    openings = openings_of(place, view, PERCEPTION, BODY, with_blind=False)
    return Node(
        number,
        "robot_0",
        np.array([*place, 0.0]),
        region(view, place=place),
        seen_region(place, view, PERCEPTION),
        openings,
        parent,
        view,
    )
