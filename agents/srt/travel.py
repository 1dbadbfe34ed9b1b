"""How a robot travels: along the legs of a way, in turns on the spot, or backwards."""

import math

import numpy as np
from numpy.typing import NDArray

from lidarium.agents.srt.candidates import Candidate
from lidarium.agents.srt.choice import Choice
from lidarium.agents.srt.memories.memory import Memory
from lidarium.agents.srt.motion.blocks import place_aside
from lidarium.agents.srt.motion.drive import Drive, Phase, driven, free_way, limits_of
from lidarium.agents.srt.motion.progress import Progress
from lidarium.agents.srt.motion.turn_plan import TURN_GAIN, TurnPlan
from lidarium.agents.srt.senses import Senses
from lidarium.agents.srt.settings import SrtSettings
from lidarium.envs.settings.lidar import Lidar
from lidarium.envs.settings.robots import Robot

BACKING_S, BACKING_SPEED = 1.5, 0.12
"""How long and how fast a blocked robot backs out [s, m/s]."""

EXACTLY = 0.03
"""Distance at which a robot is at its goal [m]."""

Command = tuple[float, float]
REST: Command = (0.0, 0.0)


class Travel:
    """The travel of one robot.

    Parameters
    ----------
    settings : SrtSettings
        How it drives.
    robot : Robot
        Its body and drive.
    lidar : Lidar
        Its laser.

    Attributes
    ----------
    legs : list of Choice
        What is left of its way.
    began_at : (2,) float64
        Where it last set out [m].
    is_aside : bool
        Whether it steps aside.
    limits : Limits
        What it is driven with.
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
        self.turns, self.progress = TurnPlan(), Progress()
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
        """Plan the turns that show the whole circle, where the robot looks around."""
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
        """Begin to drive, cutting corners where the map says that there is room."""
        if self._drive is None:
            self._cut_corner(senses, memory)
            self._drive = Drive(self.legs[0].place)

    def drive(self, senses: Senses) -> Command | None:
        """Return the next command on a leg that was begun; None when the robot is at its end."""
        assert self._drive is not None
        free = free_way(senses.scan, self._lidar, self.limits.radius)
        arrived = EXACTLY if self.legs[0].is_goal else self._settings.arrived
        self._drive, speed, turn_rate = driven(
            self._drive, senses.pose, free, self.limits, self._settings, arrived
        )
        return None if self._drive.phase is Phase.DONE else (speed, turn_rate)

    def end_leg(self) -> None:
        """Note that the robot has come to the end of a leg."""
        self.legs, self._drive = self.legs[1:], None

    def place_aside(
        self, senses: Senses, perception: float, generator: np.random.Generator
    ) -> NDArray[np.float64] | None:
        """Return a drawn place in sight to step aside to (2,) [m], None where there is none."""
        return place_aside(senses, self._lidar, self._settings, self.limits, perception, generator)

    def _cut_corner(self, senses: Senses, memory: Memory) -> None:
        if self._settings.memory != "map":
            return
        for skipped in range(len(self.legs) - 1, 0, -1):
            if memory.is_clear(senses.pose[:2], self.legs[skipped].place):
                del self.legs[:skipped]
                return
