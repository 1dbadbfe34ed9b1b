"""Orders that a robot takes and states that it reports."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.rigid import Transform

MOST_POINTS = 512
"""Maximum number of points of a path."""


class DriveState(Enum):
    """State of a robot's driving."""

    IDLE = "idle"
    DRIVING = "driving"
    ARRIVED = "arrived"
    BLOCKED = "blocked"
    NO_PATH = "no_path"
    GIVING_WAY = "giving_way"


@dataclass(frozen=True, slots=True)
class Target:
    """A target position for a robot, in its map frame.

    Attributes
    ----------
    x, y : float
        Position [m].
    heading : float or None
        Heading to turn to at the end [rad]; None for any.
    """

    x: float
    y: float
    heading: float | None = None

    def __post_init__(self) -> None:
        if not (math.isfinite(self.x) and math.isfinite(self.y)):
            raise ValueError(f"target is ({self.x}, {self.y}); want finite metres")
        if self.heading is not None and not math.isfinite(self.heading):
            raise ValueError(f"heading of the target is {self.heading}; want a finite angle or None")


@dataclass(frozen=True, eq=False, slots=True)
class Route:
    """A path that a robot should follow unchanged, in its map frame.

    Attributes
    ----------
    points : (P, 2) float64
        x, y from the robot's position to the target [m].
    room : (P,) float64
        Room around the body on the piece that leads to each point: if there is more of it, the robot cuts
        corners a little and drives faster through them [m].
    heading : float or None
        Heading to turn to at the end [rad]; None for any.

    Raises
    ------
    ValueError
        If there is no point, too many, or something is not finite.
    """

    points: NDArray[np.float64]
    room: NDArray[np.float64]
    heading: float | None = None

    def __post_init__(self) -> None:
        if self.points.ndim != 2 or self.points.shape[1] != 2 or not 1 <= len(self.points) <= MOST_POINTS:
            raise ValueError(
                f"points of the route have shape {self.points.shape}; want (P, 2) with 1 to {MOST_POINTS} points x, y"
            )
        if self.room.shape != self.points.shape[:1]:
            raise ValueError(f"room of the route has shape {self.room.shape}; want ({len(self.points)},)")
        if not (np.isfinite(self.points).all() and np.isfinite(self.room).all()):
            raise ValueError("points or room of the route are not finite; want metres")
        if self.heading is not None and not math.isfinite(self.heading):
            raise ValueError(f"heading of the route is {self.heading}; want a finite angle or None")

    @property
    def target(self) -> Target:
        """The end of the route."""
        x, y = self.points[-1].tolist()
        return Target(x, y, self.heading)


@dataclass(frozen=True, slots=True)
class Stop:
    """An action by which a robot ends its work, at any action level.

    Attributes
    ----------
    reason : str
        ``no_frontier``, ``frontier_unreachable``, ``unreachable``, ``stopped`` or a policy's own word.
    """

    reason: str


class OperatingState(Enum):
    """Whether a robot takes part in the work of its team."""

    OPERATING = "operating"
    PAUSED = "paused"
    STOPPED = "stopped"
    FAILED = "failed"

    @classmethod
    def _missing_(cls, value: object) -> None:
        raise ValueError(f"operating state is {value!r}; want one of {', '.join(state.value for state in cls)}")


class OrderKind(Enum):
    """Types of orders to a robot."""

    PAUSE = "pause"
    RESUME = "resume"
    STOP = "stop"
    EXPLORE = "explore"
    GO_TO = "go_to"

    @classmethod
    def _missing_(cls, value: object) -> None:
        raise ValueError(f"kind of the order is {value!r}; want one of {', '.join(kind.value for kind in cls)}")


@dataclass(frozen=True, slots=True)
class Order:
    """An order to a robot.

    Attributes
    ----------
    kind : OrderKind
        Type of the order; its name is accepted, too.
    target : Target or None
        The target in the robot's map frame, with ``GO_TO``; None with all other orders.
    reason : str
        Reason, for the records; with ``STOP`` the reason with which the robot ends.
    """

    kind: OrderKind
    target: Target | None = None
    reason: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "kind", OrderKind(self.kind))
        if self.kind is OrderKind.GO_TO and not isinstance(self.target, Target):
            raise ValueError(
                f"target of the order {self.kind.value!r} is {self.target!r}; want a Target, the place to go to"
            )
        if self.kind is not OrderKind.GO_TO and self.target is not None:
            raise ValueError(
                f"target of the order {self.kind.value!r} is {self.target!r}; want None, only 'go_to' has a target"
            )


@dataclass(frozen=True, slots=True)
class Status:
    """State that a robot reports in addition to its map; positions are in its map frame.

    Attributes
    ----------
    pose : Transform
        Believed pose.
    state : OperatingState
        Its operating state.
    drive : DriveState
        State of its driving.
    target : Target or None
        Target of its drive.
    path_left_m : float
        Length of the rest of its path, 0 without one [m].
    travelled_m : float
        Length of its path by its own odometry [m].
    energy_left_j : float or None
        Energy left in its battery; None if it has no limit [J].
    pause_cause : str
        Reason of a pause: ``order``, ``contact`` or ``blocked``; empty if the robot is not paused.
    """

    pose: Transform
    state: OperatingState
    drive: DriveState
    target: Target | None
    path_left_m: float
    travelled_m: float
    energy_left_j: float | None
    pause_cause: str = ""


class Orders(NamedTuple):
    """Targets of many robots.

    Attributes
    ----------
    is_ordered : (rows,) bool
        Whether the robot has a target; otherwise it keeps its position and gives way.
    targets : (rows, 2) float64
        Positions in the robots' map frames, finite if ordered [m].
    headings : (rows,) float64
        Headings to turn to at the end [rad], nan for any.
    """

    is_ordered: NDArray[np.bool_]
    targets: NDArray[np.float64]
    headings: NDArray[np.float64]

    @classmethod
    def of(cls, targets: Sequence[Target | None]) -> "Orders":
        """Return the orders of a list of targets, one for each row."""
        places = [(0.0, 0.0) if target is None else (target.x, target.y) for target in targets]
        headings = [math.nan if target is None or target.heading is None else target.heading for target in targets]
        is_ordered = np.array([target is not None for target in targets])
        return cls(is_ordered, np.array(places, np.float64).reshape(-1, 2), np.array(headings, np.float64))

    def overlaid(self, others: "Orders", rows: list[int]) -> "Orders":
        """Return these orders with those of others for some rows."""
        merged = Orders(self.is_ordered.copy(), self.targets.copy(), self.headings.copy())
        for part, other in zip(merged, others, strict=True):
            part[rows] = other[rows]
        return merged
