"""Wheel odometry: what encoders count, with bias, noise and whole ticks; and what the drive makes of a command.

Biases belong to a robot and an episode: their signs are drawn at its beginning. Noise follows the odometry motion model (turn and
distance, each from turn and distance) and the velocity motion model of Thrun, Burgard and Fox, "Probabilistic Robotics", chapter 5, with
variances that grow with the way driven, so that a model means the same whatever the time step.
"""

import math
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.simulation.noise import gaussian_at, mix, stream_key
from lidarium.mapping.checks import check_from_zero
from lidarium.mapping.kernels import Array, kernel

ENCODER_STREAM, DRIVE_STREAM = 0x6F646F6D, 0x64726976
"""Set the draws of encoders and drives apart from those of the laser."""

DISTANCE_SCALE, TURN_SCALE, DRIFT, LEFT_TRAVEL, RIGHT_TRAVEL, LEFT_TICKS, RIGHT_TICKS = range(7)
"""Places in a robot's row of wheel numbers: its biases, the travel that its wheels feign [m], and the ticks read of it."""

WHEEL_NUMBERS = 7

WHEEL_BASE, TICKS_PER_METRE = 6, 7
"""Places in ``Robot.numbers``."""


@dataclass(frozen=True, slots=True, kw_only=True)
class OdometrySettings:
    """How well wheels tell the way.

    Attributes
    ----------
    distance_bias, turn_bias : float
        Share by which distances and turns are told too long or too short all through an episode [1].
    drift : float
        Turn that a metre feigns, to the left or to the right all through an episode [rad/m].
    turn_noise_of_turn, turn_noise_of_distance : float
        Standard deviation of a turn, from the root of the turn and the root of the distance [rad^(1/2), rad/m^(1/2)].
    distance_noise_of_distance, distance_noise_of_turn : float
        Standard deviation of a distance, from the root of the distance and the root of the turn [m^(1/2), m/rad^(1/2)].
    counts_ticks : bool
        Whether encoders count whole ticks; how many make a metre is the robot's.
    speed_noise, turn_rate_noise : float
        Standard deviation of the speed and the turn rate that the drive makes of a command, as a share of it [1].
    """

    distance_bias: float = 0.0
    turn_bias: float = 0.0
    drift: float = 0.0
    turn_noise_of_turn: float = 0.0
    turn_noise_of_distance: float = 0.0
    distance_noise_of_distance: float = 0.0
    distance_noise_of_turn: float = 0.0
    counts_ticks: bool = False
    speed_noise: float = 0.0
    turn_rate_noise: float = 0.0

    def __post_init__(self) -> None:
        check_from_zero(self, "the odometry", (field.name for field in fields(self)))
        for name in ("distance_bias", "turn_bias"):
            if getattr(self, name) >= 1.0:
                raise ValueError(f"{name} of the odometry is {getattr(self, name)}; want a share below 1")

    @property
    def is_ideal(self) -> bool:
        """Whether wheels tell the truth and drives do as they are told."""
        return self == OdometrySettings()

    @property
    def disturbs_drives(self) -> bool:
        """Whether drives do not quite what they are told."""
        return self.speed_noise > 0.0 or self.turn_rate_noise > 0.0

    @property
    def numbers(self) -> NDArray[np.float64]:
        """What the kernels know of it, shape (7,): four of encoder noise, ticks or not, two of the drive's noise."""
        return np.array([
            self.turn_noise_of_turn, self.turn_noise_of_distance, self.distance_noise_of_distance, self.distance_noise_of_turn,
            float(self.counts_ticks), self.speed_noise, self.turn_rate_noise,
        ])  # fmt: skip


ODOMETRY: dict[str, OdometrySettings] = {
    "ideal": OdometrySettings(),
    "good": OdometrySettings(
        distance_bias=0.01, turn_bias=0.01, drift=0.002,
        turn_noise_of_turn=0.01, turn_noise_of_distance=0.005, distance_noise_of_distance=0.01, distance_noise_of_turn=0.002,
        counts_ticks=True, speed_noise=0.02, turn_rate_noise=0.02,
    ),
    "typical": OdometrySettings(
        distance_bias=0.05, turn_bias=0.05, drift=0.01,
        turn_noise_of_turn=0.03, turn_noise_of_distance=0.02, distance_noise_of_distance=0.02, distance_noise_of_turn=0.005,
        counts_ticks=True, speed_noise=0.03, turn_rate_noise=0.03,
    ),
    "poor": OdometrySettings(
        distance_bias=0.1, turn_bias=0.1, drift=0.03,
        turn_noise_of_turn=0.1, turn_noise_of_distance=0.05, distance_noise_of_distance=0.05, distance_noise_of_turn=0.01,
        counts_ticks=True, speed_noise=0.05, turn_rate_noise=0.05,
    ),
}  # fmt: skip
"""Odometry by name."""


@kernel(inline=True)
def within_half_turns(angle: float) -> float:
    """Return an angle in (-pi, pi] (kernel)."""
    return angle - 2.0 * math.pi * math.ceil((angle - math.pi) / (2.0 * math.pi))


def begin_wheels(settings: OdometrySettings, robots: int, seed: int) -> NDArray[np.float64]:
    """Return the wheel numbers of a team at the beginning of an episode, with the signs of the biases drawn from ``seed``."""
    signs = np.random.default_rng([seed, ENCODER_STREAM]).choice([-1.0, 1.0], (robots, 3))
    wheels = np.zeros((robots, WHEEL_NUMBERS))
    wheels[:, DISTANCE_SCALE] = 1.0 + settings.distance_bias * signs[:, 0]
    wheels[:, TURN_SCALE] = 1.0 + settings.turn_bias * signs[:, 1]
    wheels[:, DRIFT] = settings.drift * signs[:, 2]
    return wheels


@kernel(borrowing=True)
def disturb_commands(numbers: Array, noise_table: Array, seed: np.uint64, step: int, commands: Array) -> None:
    """Change the speeds and turn rates (robots, 2) of a team to what its drives make of them."""
    for robot in range(commands.shape[0]):
        key = mix(stream_key(seed, robot, step) ^ np.uint32(DRIVE_STREAM))
        commands[robot, 0] *= 1.0 + numbers[5] * gaussian_at(key, noise_table, 0)
        commands[robot, 1] *= 1.0 + numbers[6] * gaussian_at(key, noise_table, 1)


@kernel(borrowing=True)
def read_encoders(
    numbers: Array,
    noise_table: Array,
    key: np.uint32,
    wheels: Array,
    wheel_base: float,
    ticks_per_metre: float,
    velocity: Array,
    duration: float,
    measured: Array,
    odometry: Array,
) -> None:
    """Count the wheels of one robot after a step and reckon on.

    Parameters
    ----------
    numbers : (7,) float64
        ``OdometrySettings.numbers``.
    noise_table : (4096,) float32
        ``GAUSSIAN_TABLE``.
    key : uint32
        Of the robot's draws in this step, ``stream_key``.
    wheels : (7,) float64
        The robot's row of wheel numbers; updated.
    wheel_base, ticks_per_metre : float
        Distance between the wheels [m], and ticks that a wheel counts on a metre [1/m].
    velocity : (2,) float64
        Speed and turn rate that the wheels drove at [m/s, rad/s].
    duration : float
        Length of the step [s].
    measured : (2,) float64
        Result: speed and turn rate as the encoders tell [m/s, rad/s].
    odometry : (3,) float64
        x, y, theta by dead reckoning [m, rad]; updated.
    """
    key = mix(key ^ np.uint32(ENCODER_STREAM))
    distance, turn = velocity[0] * duration, velocity[1] * duration
    way, angle = abs(distance), abs(turn)
    turn_deviation = math.sqrt(numbers[0] * numbers[0] * angle + numbers[1] * numbers[1] * way)
    distance_deviation = math.sqrt(numbers[2] * numbers[2] * way + numbers[3] * numbers[3] * angle)
    turn = turn * wheels[TURN_SCALE] + distance * wheels[DRIFT] + turn_deviation * gaussian_at(key, noise_table, 0)
    distance = distance * wheels[DISTANCE_SCALE] + distance_deviation * gaussian_at(key, noise_table, 1)
    if numbers[4] != 0.0:
        wheels[LEFT_TRAVEL] += distance - 0.5 * turn * wheel_base
        wheels[RIGHT_TRAVEL] += distance + 0.5 * turn * wheel_base
        left, right = math.floor(wheels[LEFT_TRAVEL] * ticks_per_metre), math.floor(wheels[RIGHT_TRAVEL] * ticks_per_metre)
        left_way, right_way = (left - wheels[LEFT_TICKS]) / ticks_per_metre, (right - wheels[RIGHT_TICKS]) / ticks_per_metre
        wheels[LEFT_TICKS], wheels[RIGHT_TICKS] = left, right
        distance, turn = 0.5 * (left_way + right_way), (right_way - left_way) / wheel_base
    measured[0], measured[1] = distance / duration, turn / duration
    middle = odometry[2] + 0.5 * turn
    chord = distance if abs(turn) < 1e-9 else distance * math.sin(0.5 * turn) / (0.5 * turn)
    odometry[0] += chord * math.cos(middle)
    odometry[1] += chord * math.sin(middle)
    odometry[2] = within_half_turns(odometry[2] + turn)
