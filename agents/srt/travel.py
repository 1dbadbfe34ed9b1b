"""How a robot travels: along the legs of a way, in turns on the spot, or backwards."""

import math

import numpy as np
from numpy.typing import NDArray

from lidarium.agents.srt.candidates import Candidate
from lidarium.agents.srt.choice import Choice
from lidarium.agents.srt.memories import Memory
from lidarium.agents.srt.motion import Drive, Phase, driven, free_way, limits_of, place_aside
from lidarium.agents.srt.senses import Senses
from lidarium.agents.srt.settings import SrtSettings
from lidarium.envs.settings.lidar import Lidar
from lidarium.envs.settings.robots import Robot
from lidarium.mapping.geometry.rigid import wrapped

PATIENCE_S = 3.0
"""Time without motion after which a driving robot is blocked [s].

The robot has neither moved nor turned for this long.
"""

MOVED, TURNED = 0.05, 0.1
"""Minimum motion [m] and turn [rad] that count."""

BLIND_S = 10.0
"""A robot whose laser measures nothing for this long gives up [s]."""

SAME_PLACE = 0.5
"""Blocks nearer to each other than this are at one place [m]."""


class _Progress:
    """Memory of a robot's progress."""

    def __init__(self) -> None:
        self._since, self._at = 0.0, np.zeros(3)
        self._blocked_at, self._blocks = np.full(2, math.inf), 0
        self._blind_since = -math.inf

    def stand(self, senses: Senses) -> None:
        """Count from now on: the robot is not expected to have moved before."""
        self._since, self._at = senses.time_s, senses.pose

    def is_stuck(self, senses: Senses) -> bool:
        """Whether the robot has not got on for a while."""
        gap = senses.pose - self._at
        if math.hypot(gap[0], gap[1]) > MOVED or abs(wrapped(float(gap[2]))) > TURNED:
            self.stand(senses)
        return senses.time_s - self._since > PATIENCE_S

    def note_block(self, senses: Senses) -> int:
        """Note that the robot is blocked.

        Returns how often in a row it was blocked there, 1 the first time.
        """
        self._blocks = self._blocks + 1 if senses.distance_to(self._blocked_at) < SAME_PLACE else 1
        self._blocked_at = senses.pose[:2]
        return self._blocks

    def waits_for_sight(self, senses: Senses, lidar: Lidar) -> bool:
        """Whether the laser measures nothing; the robot waits until it does."""
        if not senses.is_blind(lidar):
            self._blind_since = -math.inf
            return False
        if self._blind_since < 0.0:
            self._blind_since = senses.time_s
        self.stand(senses)
        return True

    def is_blind(self, senses: Senses) -> bool:
        """Whether a robot that waits for sight has waited too long."""
        return senses.time_s - self._blind_since >= BLIND_S


MAX_TURNS = 8
"""A laser that would need more turns than this does not turn around."""

TURN_GAIN = 2.0
"""Turn rate by the error of the heading [1/s]."""


class _TurnPlan:
    """The headings to which a robot still has to turn.

    Attributes
    ----------
    focus : (2,) float64 or None
        The frontier that the robot turns to, or turned to last [m].
    """

    def __init__(self) -> None:
        self._headings: list[float] = []
        self.focus: NDArray[np.float64] | None = None

    @property
    def is_over(self) -> bool:
        """Whether no turn is left."""
        return not self._headings

    def plan_circle(self, senses: Senses, lidar: Lidar) -> None:
        """Plan the turns after which the robot has seen the whole circle."""
        field = lidar.field_of_view
        turns = math.ceil(2.0 * math.pi / field - 1e-9) - 1
        if lidar.beams == 1 or turns > MAX_TURNS:
            return
        heading = float(senses.pose[2])
        self._headings = [wrapped(heading + (2.0 * math.pi - field) * (turn + 1) / turns) for turn in range(turns)]

    def plan_frontier(self, focus: NDArray[np.float64], senses: Senses) -> None:
        """Plan the turn to a frontier that is not seen through from the robot's position at it."""
        gap = focus - senses.pose[:2]
        self._headings, self.focus = [math.atan2(gap[1], gap[0])], focus

    def error(self, senses: Senses) -> float:
        """Return by how much the robot has to turn to its next heading [rad]."""
        return wrapped(self._headings[0] - float(senses.pose[2]))

    def end_turn(self) -> None:
        """Note that the robot has turned to the next heading."""
        self._headings.pop(0)


BACKING_S, BACKING_SPEED = 1.5, 0.12
"""How long and how fast a blocked robot backs out [s, m/s]."""

EXACTLY = 0.03
"""Distance at which a robot is at its goal [m]."""

Command = tuple[float, float]
REST: Command = (0.0, 0.0)


class Travel:
    """The travel of one robot.

    Attributes
    ----------
    legs : list of Choice
        The rest of its way.
    began_at : (2,) float64
        Its last start [m].
    is_aside : bool
        Whether it steps aside.
    limits : Limits
        Its control.
    turns : TurnPlan
        Turns on the spot that are left.
    progress : Progress
        Whether it gets on.
    """

    def __init__(self, settings: SrtSettings, robot: Robot, lidar: Lidar) -> None:
        self._settings, self._lidar, self.limits = settings, lidar, limits_of(robot, settings)
        self.legs: list[Choice] = []
        self.began_at: NDArray[np.float64] = np.zeros(2)
        self.is_aside = False
        self.turns, self.progress = _TurnPlan(), _Progress()
        self._drive: Drive | None = None
        self._backs_until = -math.inf

    @property
    def target(self) -> Candidate | None:
        """The candidate at the way's end."""
        return self.legs[-1].candidate if self.legs else None

    def set_out(self, way: list[Choice], senses: Senses, *, is_aside: bool = False) -> None:
        """Begin a way that was chosen here."""
        self.follow(way, senses)
        self.began_at, self.is_aside = senses.pose[:2], is_aside

    def follow(self, way: list[Choice], senses: Senses) -> None:
        """Begin a way."""
        self.legs, self._drive, self.is_aside = way, None, False
        self.progress.stand(senses)

    def drop(self) -> None:
        """Drop the way."""
        self.legs, self._drive = [], None

    def back_out(self, senses: Senses) -> None:
        """Drive backwards for a while."""
        self._backs_until = senses.time_s + BACKING_S

    def is_backing(self, senses: Senses) -> bool:
        """Whether it still drives backwards."""
        return senses.time_s < self._backs_until

    def look_around(self, senses: Senses) -> None:
        """Plan the turns that show the whole circle, if the robot looks around."""
        if self._settings.looks_around:
            self.turns.plan_circle(senses, self._lidar)

    def turn(self, senses: Senses) -> Command | None:
        """Return the command that turns to the next heading; None when the robot is there."""
        error = self.turns.error(senses)
        if abs(error) > self._settings.turning_ends and not self.progress.is_stuck(senses):
            turn_rate = self.limits.turn_rate
            return 0.0, max(-turn_rate, min(turn_rate, TURN_GAIN * error))
        return None

    def begin_leg(self, senses: Senses, memory: Memory) -> None:
        """Begin to drive, cutting corners if the map has room."""
        if self._drive is None:
            self._cut_corner(senses, memory)
            self._drive = Drive(self.legs[0].place)

    def drive(self, senses: Senses) -> Command | None:
        """Return the next command on a leg that was begun; None when the robot is at its end."""
        assert self._drive is not None
        free = free_way(senses.scan, self._lidar, self.limits.radius)
        arrived = EXACTLY if self.legs[0].is_goal else self._settings.arrived
        self._drive, speed, turn_rate = driven(self._drive, senses.pose, free, self.limits, self._settings, arrived)
        return None if self._drive.phase is Phase.DONE else (speed, turn_rate)

    def end_leg(self) -> None:
        """Note that the robot has come to the end of a leg."""
        self.legs, self._drive = self.legs[1:], None

    def place_aside(
        self, senses: Senses, perception: float, generator: np.random.Generator
    ) -> NDArray[np.float64] | None:
        """Return a drawn place in sight to step aside to (2,) [m], None if there is none."""
        return place_aside(senses, self._lidar, self._settings, self.limits, perception, generator)

    def _cut_corner(self, senses: Senses, memory: Memory) -> None:
        if self._settings.memory != "map":
            return
        for skipped in range(len(self.legs) - 1, 0, -1):
            if memory.is_clear(senses.pose[:2], self.legs[skipped].place):
                del self.legs[:skipped]
                return
