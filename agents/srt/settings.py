"""Settings of the sensor-based random tree, with units and defaults.

They include the choices of the thesis.
"""

import math
from dataclasses import dataclass, fields
from typing import Annotated, Any

from lidarium.mapping.geometry.bounds import (
    Bounds,
    Count,
    Distance,
    Length,
    Positive,
    above,
    check_settings,
    share,
    within,
)
from lidarium.registry import unknown

SHAPES = ("ball", "star", "radial")
"""Shapes of safe regions: one radius, one for each laser region, one for each ray."""

CHOICES: dict[str, tuple[str, ...]] = {
    "shape": SHAPES,
    "algorithm": ("integrated", "base"),
    "candidates": ("goal", "random", "farthest"),
    "backtrack": ("open", "parent"),
    "memory": ("map", "regions"),
    "drive": ("turn_advance", "controls"),
}
"""Settings that are one of several words."""

Limit = Annotated[float, Bounds(0.0, 1e7, has_minimum=False, never=True)]
"""A limit, or infinity for none."""
HalfTurn = Annotated[float, above(0.0, math.pi)]
"""An angle by which a robot may have to turn [rad]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SrtSettings:
    """How a sensor-based random tree grows.

    Attributes
    ----------
    shape : str, default "radial"
        Shape of the safe regions: ``ball``, ``star`` or ``radial``.
    algorithm : str
        ``integrated`` goes to open parts of the border of the seen region; ``base`` goes in random directions,
        wherever no other safe region lies.
    candidates : str, default "goal"
        The choice of the next goal: ``goal`` (least way, and least distance to the goal if there is one), ``random``
        (an opening by its angular width) or ``farthest`` (the longest ray of an opening).
    backtrack : str, default "open"
        The choice from a node without openings: ``open`` (the cheapest node that has one, along the tree and
        its bridges) or ``parent``.
    memory : str, default "map"
        The record of seen space: ``map`` (the robot's map) or ``regions`` (the nodes' own scans).
    drive : str
        ``turn_advance`` (turn, advance, done) or ``controls`` (the best of a list of controls).
    places_nodes_at_targets : bool, default False
        Whether a node is set at the robot's target, as printed in the thesis, and not where it
        takes itself to be.
    repeats_nodes : bool, default False
        Whether a node is added again when the robot comes back to it, as printed in the thesis.
    step_share : float, default 0.8
        Share of the safe radius that the robot goes, in (0, 1).
    random_share : float, default 0.0
        Share of random choices among those of least cost. The tree is complete without: frontiers of the map
        are gone to in the end.
    way_weight : float, default 0.7
        Weight of a metre of way against a metre of distance to the goal.
    least_step : float, default 0.3
        Candidates lie farther than this from their node [m].
    least_frontier : float, default 0.8
        With ``candidates`` ``goal`` and ``memory`` ``map``, frontiers of the map of at least this length are
        gone to; shorter ones when nothing else is left [m].
    tries : int, default 20
        How many candidates are drawn at a node.
    nodes : int, default 500
        Budget of nodes of each robot.
    time_s : float, default inf
        Budget of simulated time of each robot, without the way home [s].
    perception : float, default inf
        Rays count as far as this, and at most as the laser sees [m].
    margin : float, default 0.05
        Safe radii end this far before an obstacle, besides the robot's radius [m].
    turn_room : float, default 0.0
        A laser region with a return nearer than the robot's radius, the margin and this is not safe [m]; 0
        for off.
    passing_distance : float, default 1.5
        On its way a robot adds a node after this distance [m].
    looks_around : bool, default True
        Whether a robot turns to see the space behind it, at its first node and at nodes that are left without
        openings.
    turning_starts, turning_ends : float
        The robot turns on the spot if its heading is off by more than the first, until it is off by less
        than the second [rad].
    speed : float, default inf
        Greatest speed [m/s]; the robot's cruise speed if that is lower.
    turn_rate : float, default 1.5
        Greatest turn rate [rad/s].
    arrived : float, default 0.1
        Distance at which a robot has reached its target [m].
    """

    shape: str = "radial"
    algorithm: str = "integrated"
    candidates: str = "goal"
    backtrack: str = "open"
    memory: str = "map"
    drive: str = "turn_advance"
    places_nodes_at_targets: bool = False
    repeats_nodes: bool = False
    step_share: Annotated[float, share(has_minimum=False, has_maximum=False)] = 0.8
    random_share: Annotated[float, share()] = 0.0
    way_weight: Positive = 0.7
    least_step: Length = 0.3
    least_frontier: Length = 0.8
    tries: Annotated[int, within(1, 10_000)] = 20
    nodes: Count = 500
    time_s: Limit = math.inf
    perception: Limit = math.inf
    margin: Distance = 0.05
    turn_room: Distance = 0.0
    passing_distance: Limit = 1.5
    looks_around: bool = True
    turning_starts: HalfTurn = math.radians(40.0)
    turning_ends: HalfTurn = math.radians(15.0)
    speed: Limit = math.inf
    turn_rate: Positive = 1.5
    arrived: Length = 0.1

    def __post_init__(self) -> None:
        check_settings(self, "the tree")
        for name, words in CHOICES.items():
            if getattr(self, name) not in words:
                raise ValueError(f"{name} of the tree is {getattr(self, name)!r}; want one of {', '.join(words)}")
        if not self.turning_ends < self.turning_starts:
            raise ValueError(
                f"turning_starts is {self.turning_starts} rad; want more than turning_ends "
                f"({self.turning_ends} rad) and at most pi"
            )


THESIS: dict[str, Any] = {
    "shape": "star",
    "candidates": "random",
    "backtrack": "parent",
    "memory": "regions",
    "places_nodes_at_targets": True,
    "repeats_nodes": True,
    "step_share": 0.9,
    "perception": 0.9,
    "margin": 0.03,
    "least_step": 0.25,
    "turn_room": 0.05,
    "looks_around": False,
    "passing_distance": math.inf,
    "turning_starts": math.radians(15.0),
    "turning_ends": math.radians(5.0),
    "speed": 0.3,
    "turn_rate": 0.8,
}
"""Settings of ``mode="thesis"``.

Settings that are given themselves come first.
"""


def make_srt_settings(mode: str = "default", **settings: Any) -> SrtSettings:  # noqa: ANN401
    """Return the settings of a mode, some of them given."""
    modes: dict[str, dict[str, Any]] = {"default": {}, "thesis": THESIS}
    if mode not in modes:
        raise ValueError(f"mode of the tree is {mode!r}; want one of {', '.join(modes)}")
    known = [field.name for field in fields(SrtSettings)]
    for name in settings:
        if name not in known:
            raise ValueError(unknown("setting", name, ["mode", *known]))
    return SrtSettings(**{**modes[mode], **settings})
