"""Report of a policy on an episode."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

from lidarium.envs.onboard.radio.messages import OrderKind
from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.merging.fusion import FusedMap
from lidarium.mapping.merging.pair import PairResult


@dataclass(frozen=True, slots=True)
class GivenUp:
    """Something that a robot left unexplored, and why.

    Attributes
    ----------
    agent : str
        Who gave it up.
    x, y : float
        Position in that robot's map frame [m].
    size_m : float
        How long the frontier is [m].
    reason : str
        ``unseen`` (nothing new is seen from as near as the body comes), ``hidden`` (behind something
        occupied), ``narrow`` or ``blocked`` (no path for the body), ``no_progress`` (there is a path, but the
        robot does not advance).
    """

    agent: str
    x: float
    y: float
    size_m: float
    reason: str


@dataclass(frozen=True, slots=True)
class Join:
    """The transform between the map frames of two robots, as a station found it.

    Attributes
    ----------
    time_s : float
        When [s].
    a, b : str
        The robots.
    found : Transform
        Of b's map frame in that of a.
    at : (x, y)
        Point at which errors are taken, the middle of the area known to both maps, in b's frame [m].
    is_used : bool
        Whether decisions were built on it; otherwise it waited to be confirmed.
    is_direct : bool
        Whether these two maps were aligned; otherwise those of others lie between them.
    """

    time_s: float
    a: str
    b: str
    found: Transform
    at: tuple[float, float]
    is_used: bool
    is_direct: bool = True


@dataclass(frozen=True, slots=True)
class GivenOrder:
    """An order that a station gave a robot.

    Attributes
    ----------
    time_s : float
        When [s].
    agent : str
        The robot.
    kind : OrderKind
        The order.
    place : (float, float)
        Its position, in its own map frame [m].
    goal : (float, float) or None
        Its goal, in its own map frame [m].
    """

    time_s: float
    agent: str
    kind: OrderKind
    place: tuple[float, float]
    goal: tuple[float, float] | None = None


class LogEntry(Protocol):
    """An entry of a station's log."""

    @property
    def time_s(self) -> float:
        """When [s]."""
        ...

    def as_dict(self) -> dict[str, Any]:
        """Return it as values for JSON."""
        ...


@dataclass(frozen=True, slots=True)
class Supervision:
    """Record of a station in an episode.

    Attributes
    ----------
    joins : sequence of Join
        How the frames of robots lie, as it found.
    orders : sequence of GivenOrder
        The orders that it gave.
    log : sequence of LogEntry
        All that it decided and all that happened to it, by time.
    figures : mapping
        The entry ``supervisor`` of ``result.json``.
    tick_seconds, merge_seconds : sequence of float
        Wall time of each decision and of each merge between decisions [s].
    """

    joins: Sequence[Join] = ()
    orders: Sequence[GivenOrder] = ()
    log: Sequence[LogEntry] = ()
    figures: Mapping[str, Any] | None = None
    tick_seconds: Sequence[float] = ()
    merge_seconds: Sequence[float] = ()


@dataclass(frozen=True, slots=True, eq=False)
class JoinedGroup:
    """Robots with joined maps.

    Attributes
    ----------
    frames : mapping of str to Transform
        Of each robot's map frame in that of the group's first robot.
    fused : FusedMap or None
        Their merged map in that frame; None if nobody has merged it.
    """

    frames: Mapping[str, Transform]
    fused: FusedMap | None = None


@dataclass(frozen=True, slots=True, eq=False)
class TeamMaps:
    """How the maps of a team lie, as far as is known in the end.

    Attributes
    ----------
    groups : sequence of JoinedGroup
        Each robot is in one; who is joined with nobody is alone in it.
    pairs : mapping of (str, str) to PairResult
        Results of the pairs of maps that were tried last, between the maps' lower left corners.
    corners : mapping of str to Transform
        Of these lower left corners in the robots' map frames.
    used, dropped : frozenset of (str, str)
        The pairs by which the groups are joined, and those that contradict stronger ones.
    """

    groups: Sequence[JoinedGroup]
    pairs: Mapping[tuple[str, str], PairResult] = field(default_factory=dict)
    corners: Mapping[str, Transform] = field(default_factory=dict)
    used: frozenset[tuple[str, str]] = frozenset()
    dropped: frozenset[tuple[str, str]] = frozenset()


@dataclass(frozen=True, slots=True)
class PolicyReport:
    """Report of a policy on an episode, at its end or during it.

    Attributes
    ----------
    given_up : sequence of GivenUp
        Areas left unexplored, with reasons.
    supervision : Supervision or None
        Record of its station; None without a station.
    decided_by : mapping of str to int
        How often a robot set out, by the part of the policy that sent it; empty for policies of one part.
    """

    given_up: Sequence[GivenUp] = ()
    supervision: Supervision | None = None
    decided_by: Mapping[str, int] = field(default_factory=dict)
