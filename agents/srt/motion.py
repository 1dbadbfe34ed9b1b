"""Driving to a place in sight: turn, advance, done.

Or the best of a list of controls. Both stop before obstacles that the laser sees ahead.
"""

import math
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from lidarium.agents.srt.safe_region import no_return, safe_region, view_of
from lidarium.agents.srt.senses import Senses
from lidarium.agents.srt.settings import SrtSettings
from lidarium.envs.settings.lidar import Lidar
from lidarium.envs.settings.robots import Robot
from lidarium.mapping.geometry.rigid import wrapped
from lidarium.mapping.grids.scan_geometry import ScanGeometry

GAP = 0.03
"""The robot stops this far before what it sees ahead [m]."""

SIDE = 0.01
"""Obstacles within the robot's radius plus this of its way are ahead [m]."""

ALONG = 0.001
"""Advance allowed towards what is nearer beside the body than ``SIDE`` [m].

The robot may come this much nearer to it on its path.
"""

NEAR, STRAIGHT = 0.5, math.radians(2.0)
"""Free distance below which a robot turns first [m], and to what error [rad].

Where the path ahead is free for less, the robot turns until its heading error is below the second value.
"""

TURN_GAIN = 2.0
"""Turn rate for each radian that the heading is off [1/s]."""

CONTROL_SPEEDS, CONTROL_TURNS = (0.0, 1.0 / 3.0, 1.0), (-1.0, -0.5, 0.0, 0.5, 1.0)
"""Shares of the greatest speed and turn rate that make the list of controls."""

FORESIGHT_S = 0.2
"""Time for which the pose after a control is predicted [s]."""

HEADING_WEIGHT = 0.3
"""Cost of a radian off the heading to the target in the list of controls [m]."""


class Phase(Enum):
    """States of the drive."""

    TURN = "turn"
    ADVANCE = "advance"
    DONE = "done"


@dataclass(frozen=True, slots=True)
class Drive:
    """A drive to a target, and the state that it is in.

    Attributes
    ----------
    target : (2,) float64
        Goal [m].
    phase : Phase
        The state.
    """

    target: NDArray[np.float64]
    phase: Phase = Phase.TURN


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits of a robot: speed [m/s], turn rate [rad/s], deceleration, radius [m].

    Speed and turn rate are the greatest ones; deceleration is in m/s2.
    """

    speed: float
    turn_rate: float
    deceleration: float
    radius: float


def limits_of(robot: Robot, settings: SrtSettings) -> Limits:
    """Return the control that the settings ask for."""
    speed, turn_rate = min(settings.speed, robot.cruise_speed), min(settings.turn_rate, robot.max_turn_rate)
    return Limits(speed, turn_rate, 0.5 * robot.max_acceleration, robot.radius)


def free_way(scan: NDArray[np.float32], geometry: ScanGeometry, radius: float, heading: float = 0.0) -> float:
    """Return how far the robot can go before it meets an obstacle that the laser sees.

    Parameters
    ----------
    scan : (beams,) float32
        Ranges [m].
    geometry : ScanGeometry
        The laser.
    radius : float
        Radius of the body [m].
    heading : float
        Direction of the path against the robot's heading [rad].

    Returns
    -------
    float
        Length of the way [m]; the laser's maximum range if nothing is met.
    """
    ranges = np.asarray(scan, np.float64)
    is_hit = (ranges >= geometry.range_min) & (ranges < no_return(geometry))
    angles = geometry.angles[is_hit] - heading
    along, across = ranges[is_hit] * np.cos(angles), ranges[is_hit] * np.sin(angles)
    # Past what a robot stands beside already it gets as near: along a wall it must not take the wall for an
    # end of its way.
    half = min(radius + SIDE, max(radius, float(ranges[is_hit].min(initial=math.inf)) - ALONG))
    is_ahead = (along > 0.0) & (np.abs(across) < half)
    reach = along[is_ahead] - np.sqrt(half * half - across[is_ahead] ** 2)
    return max(float(reach.min(initial=geometry.range_max)), 0.0)


def _stopping_speed(distance: float, deceleration: float) -> float:
    """Return the speed from which a robot stops within a distance [m/s]."""
    return math.sqrt(2.0 * deceleration * max(distance, 0.0))


def driven(
    drive: Drive,
    pose: NDArray[np.float64],
    free: float,
    limits: Limits,
    settings: SrtSettings,
    arrived: float,
) -> tuple[Drive, float, float]:
    """Return a drive's next state, speed [m/s] and turn rate [rad/s].

    The speed and turn rate are for one step.

    Parameters
    ----------
    drive : Drive
        The drive so far.
    pose : (3,) float64
        Believed pose of the robot [m, rad].
    free : float
        How far the path ahead is free [m].
    limits : Limits
        Its abilities.
    settings : SrtSettings
        ``turn_advance`` or ``controls``, and the angles between which it turns.
    arrived : float
        Distance at which it is done [m].
    """
    gap = drive.target - pose[:2]
    distance, error = math.hypot(*gap), wrapped(math.atan2(gap[1], gap[0]) - float(pose[2]))
    if distance <= arrived:
        return replace(drive, phase=Phase.DONE), 0.0, 0.0
    fastest = min(
        limits.speed,
        _stopping_speed(distance, limits.deceleration),
        _stopping_speed(free - GAP, limits.deceleration),
    )
    if settings.drive == "controls":
        speed, turn_rate = _best_control(pose, drive.target, fastest, limits)
        return replace(drive, phase=Phase.ADVANCE if speed > 0.0 else Phase.TURN), speed, turn_rate
    # Past something near by a robot has to go straight: it would drift towards it while it turns the rest.
    ends = min(settings.turning_ends, STRAIGHT) if free < min(distance, NEAR) else settings.turning_ends
    limit = ends if drive.phase is Phase.TURN else settings.turning_starts
    turn_rate = max(-limits.turn_rate, min(limits.turn_rate, TURN_GAIN * error))
    if abs(error) > limit:
        return replace(drive, phase=Phase.TURN), 0.0, turn_rate
    return replace(drive, phase=Phase.ADVANCE), fastest * math.cos(error), turn_rate


def _best_control(
    pose: NDArray[np.float64], target: NDArray[np.float64], fastest: float, limits: Limits
) -> tuple[float, float]:
    """Return the listed control with the predicted pose that best suits a target.

    The control is a speed and a turn rate; the best pose is closest to the target and faces it.

    Parameters
    ----------
    pose : (3,) float64
        Believed pose of the robot [m, rad].
    target : (2,) float64
        Its target [m].
    fastest : float
        Speed that the path ahead allows [m/s]; controls are no faster.
    limits : Limits
        Abilities of the robot.
    """
    best, least = (0.0, 0.0), math.inf
    for speed_share in CONTROL_SPEEDS:
        for turn_share in CONTROL_TURNS:
            speed, turn_rate = min(speed_share * limits.speed, fastest), turn_share * limits.turn_rate
            heading = float(pose[2]) + turn_rate * FORESIGHT_S
            middle = float(pose[2]) + 0.5 * turn_rate * FORESIGHT_S
            x = float(pose[0]) + speed * FORESIGHT_S * math.cos(middle)
            y = float(pose[1]) + speed * FORESIGHT_S * math.sin(middle)
            gap_x, gap_y = float(target[0]) - x, float(target[1]) - y
            cost = math.hypot(gap_x, gap_y) + HEADING_WEIGHT * abs(wrapped(math.atan2(gap_y, gap_x) - heading))
            if cost < least - 1e-12:
                best, least = (speed, turn_rate), cost
    return best


TEAMMATE_NEAR = 1.5
"""A teammate within this distance may be what blocks a robot [m]."""

ASIDES = 6
"""How often in a row a robot steps aside on its way before it gives its target up."""

ASIDE_DISTANCES = 0.3, 1.2
"""Nearest and farthest place to which a robot steps aside [m]."""


class Remedy(Enum):
    """Behaviour of a blocked robot."""

    GIVE_GOAL_UP = "give_goal_up"
    STEP_ASIDE = "step_aside"
    BACK_OUT = "back_out"


class Blocks:
    """How often a robot was blocked, and stepped aside, without coming anywhere.

    Attributes
    ----------
    asides : int
        How often in a row it has stepped aside.
    failures : int
        How often in a row it was blocked.
    """

    def __init__(self) -> None:
        self.asides = self.failures = 0

    @property
    def are_hopeless(self) -> bool:
        """Whether the robot was blocked too often in a row."""
        return self.failures > ASIDES

    def remedy(self, senses: Senses, here: int, *, is_goal: bool) -> Remedy:
        """Return the action now, and count."""
        self.failures += 1
        steps_aside = here % 3 == 2 or any(
            senses.distance_to(teammate) < TEAMMATE_NEAR for teammate in senses.teammates
        )
        if is_goal and self.are_hopeless:
            # What stands there, such as teammates who have come to the same goal, does not go away.
            self.failures = 0
            return Remedy.GIVE_GOAL_UP
        if steps_aside and self.asides < ASIDES:
            self.asides += 1
            return Remedy.STEP_ASIDE
        self.asides = 0
        return Remedy.BACK_OUT


def place_aside(
    senses: Senses,
    lidar: Lidar,
    settings: SrtSettings,
    limits: Limits,
    perception: float,
    generator: np.random.Generator,
) -> NDArray[np.float64] | None:
    """Return a drawn place in sight to step aside to (2,) [m], None if there is none.

    Of two robots that block each other, one thus lets the other pass. What is farther than ``perception``
    [m] counts as unseen.
    """
    region = safe_region(
        senses.pose[:2],
        view_of(senses.scan, lidar, float(senses.pose[2])),
        float(senses.pose[2]),
        "radial",
        limits.radius,
        perception,
    )
    for _ in range(settings.tries):
        angle = float(generator.uniform(-math.pi, math.pi))
        distance = float(generator.uniform(*ASIDE_DISTANCES))
        if region.radius_at(angle) >= distance:
            return np.asarray(region.place + distance * np.array([math.cos(angle), math.sin(angle)]))
    return None
